"""The page's sentences in each language: whole, and with the numbers that English has. Made from
the event table and the page itself."""

import json
import re
from pathlib import Path

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from messages import events
from messages.message import Notice
from services.cockpit.core import Patience
from services.cockpit.io.files import PageFiles
from services.link_monitor.core import LinkAlarm
from services.piloting.keys import KEYS
from services.reference.failsafe.table import table
from services.reference.settings import FailsafeSettings
from services.vehicle_view.view import DOES, NOT_OBEYED, VehicleView

FILES = PageFiles().contents
PAGE = {name: text.decode() for name, text in FILES.items()}
SENTENCES = {
    name[6:8]: json.loads(text) for name, text in PAGE.items() if name.startswith("words_")
}
ON_DISK = Path("services/cockpit/page")
ENGLISH = SENTENCES["en"]
OTHERS = sorted(set(SENTENCES) - {"en"})
S = 1_000_000_000  # [ns]
MOST = 60_000  # [B] that are sent of a page that is opened, with one language beside English


def numbers(sentence: str) -> list[str]:
    return sorted(re.findall(r"\{\w+\}", sentence))


def test_the_languages_are_those_of_the_list():
    listed = re.findall(r"(\w\w): \"", PAGE["words.js"])
    assert sorted(listed) == sorted(SENTENCES) == ["de", "en", "es", "no", "sv", "zh"]


@pytest.mark.parametrize("language", OTHERS)
def test_nothing_is_missing_and_every_number_is_where_english_has_it(language: str):
    own = SENTENCES[language]
    assert sorted(own) == sorted(ENGLISH)
    assert {key: numbers(own[key]) for key in own} == {key: numbers(ENGLISH[key]) for key in own}
    assert all(own.values())
    long = [key for key, sentence in ENGLISH.items() if len(sentence.split()) > 3]
    assert [key for key in long if own[key] == ENGLISH[key]] == []


def test_every_sentence_that_the_page_asks_for_is_there():
    asked = set(re.findall(r'data-t="([^"]+)"', PAGE["index.html"]))
    for name, text in PAGE.items():
        if name.endswith(".js"):
            asked |= set(re.findall(r'words\.t\("([^"]+)"', text))
    asked |= {f"key.{key.action}" for key in KEYS}
    assert asked - set(ENGLISH) == set()


def test_whatever_the_drone_does_by_itself_can_be_said():
    acting = [row for row in table(FailsafeSettings()) if row.acts]
    keys = {f"does.{does}" for does in ("stopping", NOT_OBEYED, *DOES.values())}
    keys |= {f"notice:{row.name}{part}" for row in acting for part in ("", ".short", ".do")}
    keys |= {f"back.{row.name}" for row in acting if row.brief}
    assert len(acting) == 6
    assert keys <= set(ENGLISH)


def test_whatever_the_drone_can_say_has_a_sentence_in_every_language():
    """By its code: nothing is parsed, and no screen has to know the English of it."""
    codes = {f"notice:{row.name}" for row in table(FailsafeSettings())}
    codes |= {*events.TOLD, events.ALARM_PEERS.name, events.ALARM_JUNK.name}
    codes.add(events.CLAMPED_HORIZONTAL.name)
    assert codes <= set(ENGLISH)
    names = {name[1:-1] for key in codes for name in numbers(ENGLISH[key])}
    assert names == {"s", "from", "to"}
    assert set(re.findall(r"(\w+): \(", PAGE["words.js"])) >= set(events.AMOUNTS)


def test_a_drone_that_is_not_heard_rises_when_its_failsafe_says_so():
    assert Patience().pilot_patience == FailsafeSettings().pilot_patience
    view = VehicleView(armed=True, silent_s=12.0)
    assert Patience(40.0).counted(view).next_s == 29.0  # a second until it has noticed
    assert Patience(5.0).counted(view).next_s == 0.0
    assert Patience().counted(VehicleView(silent_s=12.0)).next_s is None


def test_an_alarm_of_the_link_is_known_in_every_language_whatever_its_numbers():
    alarm = LinkAlarm()
    alarm.sent(0)
    said = [alarm.notice(60 * S)]
    for k in range(40):
        alarm.answered(40.0)
        alarm.sent(k)
    for _ in range(20):
        alarm.answered(900.0)
    said.append(alarm.notice(0))
    alarm.sent(60 * S)
    said.append(alarm.notice(90 * S))
    assert said == [
        Notice("link.never"),
        Notice("link.rtt", {"from": 40, "to": 900}),
        Notice("link.silent", {"s": 30.0}),
    ]
    for notice in filter(None, said):
        assert [f"{{{name}}}" for name in sorted(notice.numbers)] == numbers(ENGLISH[notice.code])


def test_what_is_wrong_with_the_picture_is_said_in_every_language():
    keys = set(re.findall(r'"(video\.\w+)"', PAGE["video.js"]))
    assert len(keys) == 6
    assert keys <= set(ENGLISH)


def test_a_page_is_light():
    sent = {name: len(body) for name, body in PageFiles().packed.items()}
    languages = [sent[f"words_{language}.json"] for language in OTHERS]
    rest = sum(size for name, size in sent.items() if name[6:8] not in OTHERS)
    assert rest + max(languages) <= MOST


def test_the_files_are_where_translators_find_them():
    for language in OTHERS:
        text = (ON_DISK / f"words_{language}.json").read_text()
        own = json.loads(text)
        assert text == json.dumps(dict(sorted(own.items())), indent=2, ensure_ascii=False) + "\n"
