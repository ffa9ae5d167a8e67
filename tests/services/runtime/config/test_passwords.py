"""No part of a password in an address is shown or recorded."""

import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from services.recorder.io.attachments import attachments
from services.recorder.io.mcap_session import about
from services.runtime.config.passwords import without_passwords
from services.runtime.config.stack import Stack

LETTERS = st.characters(min_codepoint=33, max_codepoint=126, exclude_characters="\"'")
SECRETS = st.text(LETTERS, min_size=6, max_size=20).map(lambda text: f"Geh{text}eim")


@given(SECRETS, st.text(LETTERS, max_size=10))
def test_nothing_of_a_password_before_the_host_is_left(secret: str, user: str):
    shown = without_passwords(f"source is rtsp://{user}:{secret}@camera/live now")
    assert secret not in shown
    assert "Geh" not in shown
    assert "eim" not in shown


def test_a_query_is_left_out_and_the_rest_stays():
    address = (
        "rtsp://pilot:Geh@eim77@127.0.0.1:8554/live?user=adm&password=Quer77 gives no pictures"
    )
    assert without_passwords(address) == "rtsp://…@127.0.0.1:8554/live?… gives no pictures"


@given(st.text(st.characters(exclude_characters="@?")))
def test_other_text_stays_as_it_is(text: str):
    assert without_passwords(text) == text


def test_no_recording_holds_a_password(tmp_path: Path):
    secret = "Geh@eim77"
    vehicle = tmp_path / "mine.toml"
    shipped = Stack().vehicle_path.read_text()
    vehicle.write_text(f'{shipped}\n[camera]\nsource = "rtsp://pilot:{secret}@camera/live"\n')
    stack = Stack(
        vehicle=str(vehicle), overrides=[f"camera.source=rtsp://pilot:{secret}@10.0.0.2/live"]
    )
    whole = [json.dumps(about(stack)), *(file.data.decode() for file in attachments(stack))]
    assert len(whole) > 2
    for text in whole:
        assert "Geh" not in text
        assert "eim77" not in text
