"""The page's sentences in each language: whole, and with the numbers that English has. Made from
the event table and the page itself."""

import json
import re
from itertools import product
from typing import cast

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from messages.vehicle import Failsafe, Reaction, VehicleStatus
from services.cockpit.io.files import PageFiles
from services.cockpit.page_view import acting
from services.link_monitor.core import LinkAlarm
from services.piloting.keys import KEYS
from services.reference.failsafe.table import ACTING
from services.vehicle_view.view import DOES, Newest, vehicle_view

FILES = PageFiles().contents
PAGE = {name: text.decode() for name, text in FILES.items()}
SENTENCES = {
    name[6:8]: json.loads(text) for name, text in PAGE.items() if name.startswith("words_")
}
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


@pytest.mark.parametrize("does", ["stopping", *DOES.values()])
def test_whatever_the_drone_does_by_itself_is_said_in_four_sentences(does: str):
    names = [key.removesuffix(".short") for key in ENGLISH if key.endswith(".short")]
    assert len(names) == 6
    reactions: dict[str, Reaction] = {words: reaction for reaction, words in DOES.items()}
    reactions["stopping"] = "stop"
    for name, resumable in product(names, (False, True)):
        status = VehicleStatus(
            stamp_ns=0,
            activity="stopping" if does == "stopping" else "ready",
            armed=True,
            failsafe=cast(Failsafe, name.removeprefix("notice:")),
            reaction=reactions[does],
            since_ns=0,
            resumable=resumable,
        )
        assert status.reaction in ACTING
        said = [key for key, _ in acting(vehicle_view(Newest(status), 5))]
        keys = [key.replace("failsafe:", "notice:") for key in said]
        assert len(keys) == 4
        assert all(ENGLISH[key] for key in keys)


def test_an_alarm_of_the_link_is_known_in_every_language_whatever_its_numbers():
    alarm = LinkAlarm()
    alarm.sent(0)
    said = {"link.never": alarm.text(60 * S)}
    for k in range(40):
        alarm.answered(40.0)
        alarm.sent(k)
    for _ in range(20):
        alarm.answered(900.0)
    said["link.rtt"] = alarm.text(0)
    alarm.sent(60 * S)
    said["link.silent"] = alarm.text(90 * S)
    for key, text in said.items():
        template = re.sub(r"\\\{\w+\\\}", "[0-9.]+", re.escape(ENGLISH[key]))
        assert re.fullmatch(template, text), (key, text)


def test_what_is_wrong_with_the_picture_is_said_in_every_language():
    keys = set(re.findall(r'"(video\.\w+)"', PAGE["video.js"]))
    assert len(keys) == 6
    assert keys <= set(ENGLISH)


def test_a_page_is_light():
    sent = {name: len(body) for name, body in PageFiles().packed.items()}
    languages = [sent[f"words_{language}.json"] for language in OTHERS]
    rest = sum(size for name, size in sent.items() if name[6:8] not in OTHERS)
    assert rest + max(languages) <= MOST
