"""What a dive's choices must be before anything starts: names, sensors, passwords."""

import json
import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.estimation.settings import Settings as Estimation
from services.recorder.io.attachments import attachments
from services.recorder.io.mcap_session import about
from services.runtime.config.errors import LindyError
from services.runtime.config.passwords import without_passwords
from services.runtime.config.settings import DEPLOY, convert, deploy_file, reading_copies
from services.runtime.config.stack import NamedSensors, Stack, read_part
from services.runtime.hosts.registry import Registry
from services.simulator.settings import Settings as Simulator
from tools.checks import known_tables


def test_a_vehicle_is_called_as_its_file_calls_it() -> None:
    assert Stack(vehicle="bluerov2_heavy").vehicle_name == "bluerov2_heavy"
    example = deploy_file("vehicles", "pioneer").parents[2] / "examples/point_vehicle/vehicle.toml"
    assert Stack(vehicle=str(example)).vehicle_name == "point_vehicle"


@given(st.text())
def test_a_vehicles_name_is_a_chunk_of_a_key(name: str) -> None:
    stack = Stack()
    vars(stack)["_own_tree"] = {"vehicle": {"name": name}}
    assert re.fullmatch(r"[a-z0-9_]+", stack.vehicle_name)


# Sensors that a vehicle file names: their figures lie under what it states.


PARTS = sorted((DEPLOY / "sensors").glob("*.toml"))
OF_KIND = {"imu": ("imu", "gyro", "accelerometer"), "pressure": ("pressure",)}


@pytest.mark.parametrize("path", PARTS, ids=lambda path: path.stem)
def test_every_shipped_part_is_valid_and_has_figures_of_its_kind_alone(path: Path) -> None:
    part = read_part(path)
    assert part.kind in NamedSensors.__struct_fields__
    convert(part.simulator, Simulator, "simulator", path)
    convert(part.estimation, Estimation, "estimation", path)
    assert part.simulator
    kinds = OF_KIND.get(part.kind, (part.kind,))
    assert all(key.split("_")[0] in kinds for key in part.simulator)
    assert path.read_text().startswith("# "), "where its figures come from"


def test_a_parts_figures_count_where_the_vehicle_states_none() -> None:
    stack = Stack(overrides=["sensors.imu=mpu-6000", "simulator.gyro_noise=1e-5"])
    found, part = stack.section("simulator", Simulator), read_part(DEPLOY / "sensors/mpu-6000.toml")
    assert found.accelerometer_noise == part.simulator["accelerometer_noise"]
    assert found.gyro_noise == 1e-5
    assert found.pressure_std == 500.0  # of the vehicle file, beside it
    told = stack.section("estimation", Estimation)
    assert told.depth.acceleration_noise == part.estimation["depth"]["acceleration_noise"]
    assert told.depth.pressure_std == 500.0


@pytest.mark.parametrize(
    ("option", "sentence"),
    [
        ("sensors.imu=icm-2062", "unknown part 'icm-2062'; did you mean 'icm-20602'? known: bno"),
        ("sensors.imu=mmc5983", "'mmc5983' is of the kind 'magnetometer'; known: bno085, icm-"),
        ("sensors.pressure=none.toml", "there is no file none.toml"),
        ("sensors.usbl=a50", "unknown key; known: dvl, imu, magnetometer, pressure"),
        ("sensors=3", "expected a table, found 3; its keys: dvl, imu, magnetometer, pressure"),
        ("sensors.imu=3", "expected text, found 3"),
    ],
)
def test_a_part_that_there_is_not_is_one_sentence_about_the_option(
    option: str, sentence: str
) -> None:
    stack = Stack(overrides=[option])
    for ask in (
        lambda: stack.section("simulator", Simulator),
        lambda: stack.check(known_tables(Registry.read())),
    ):
        with pytest.raises(LindyError) as told:
            ask()
        assert sentence in str(told.value)
        assert str(told.value).startswith(f"--set {option}: ")
        assert "\n" not in str(told.value)


def vehicle_with(tmp_path: Path, part: str) -> Stack:
    """The Pioneer with a part of one's own as its IMU."""
    (tmp_path / "mine.toml").write_text(part)
    path, body = tmp_path / "vehicle.toml", (DEPLOY / "vehicles/pioneer.toml").read_text()
    path.write_text(f'[sensors]\nimu = "{tmp_path}/mine.toml"\n\n{body}')
    return Stack(vehicle=str(path))


def test_a_part_may_be_ones_own_and_is_kept_with_the_dive(tmp_path: Path) -> None:
    stack = vehicle_with(tmp_path, 'kind = "imu"\n[simulator]\ngyro_noise = 3e-4\n')
    stack.check(known_tables(Registry.read()))
    assert stack.section("simulator", Simulator).gyro_noise == 3e-4
    assert tmp_path / "mine.toml" in stack.files
    copy = tmp_path / "copy"
    copy.write_text('kind = "imu"\n[simulator]\ngyro_noise = 5e-4\n')
    (tmp_path / "mine.toml").unlink()
    with reading_copies({str(tmp_path / "mine.toml"): str(copy)}):
        again = msgspec.structs.replace(stack)
        assert again.section("simulator", Simulator).gyro_noise == 5e-4


@pytest.mark.parametrize(
    ("part", "sentence"),
    [
        (
            'kind = "imu"\n[simulator]\ngyro_nose = 1',
            "mine.toml:3: simulator.gyro_nose: unknown key",
        ),
        (
            'kind = "imu"\n[simulator]\ngyro_noise = -1',
            "mine.toml:3: simulator.gyro_noise: expected",
        ),
        ('kind = "imu"\n[control]\nkp = 1', "mine.toml:2: control: unknown key"),
        ("[simulator]", "mine.toml: this file: the key kind is missing"),
        ('kind = "compass"', "is of the kind 'compass'; known: bno085"),
        ("kind = ", "mine.toml: not valid TOML"),
    ],
)
def test_a_mistake_in_a_part_names_its_file(tmp_path: Path, part: str, sentence: str) -> None:
    with pytest.raises(LindyError) as told:
        vehicle_with(tmp_path, part).section("simulator", Simulator)
    assert sentence in str(told.value)
    assert "\n" not in str(told.value)


# No part of a password in an address is shown or recorded.


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
