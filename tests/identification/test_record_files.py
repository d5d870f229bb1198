"""Record files: their meaning, and mistakes with their places."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from benchmarks.identify.cases import ARM, arm, record
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

import fantoccini as fan
from fantoccini import puppets
from fantoccini.app.cli.app import app
from fantoccini.app.cli.identify import print_motions
from fantoccini.base.documents.yaml_text import read_text
from fantoccini.base.errors import FileError, StateError
from fantoccini.base.files import write_table
from fantoccini.lab.identification import record_schema
from fantoccini.lab.identification.estimating import NoiseLevels
from fantoccini.lab.identification.marking import find_number, missing_files, write_numbers
from fantoccini.model.puppet.written import parameters

pytestmark = pytest.mark.medium

PUPPET_YAML = ARM.replace("{parameter: upper_mass, value: 0.13}", "0.13 # weighed badly").replace(
    "{parameter: lower_mass, value: 0.12}", "0.1"
)
RECORD_YAML = """\
record: swing
puppet: arm.yaml
samples: swing.csv
markers:
  middle: {body: upper, at: [0, 0.015, -0.15]}
  wrist: {body: lower, at: [0.012, 0, -0.1]}
  tip: {body: lower, at: [0, 0, -0.25], find: true}
unknown:
  upper.mass:
  shoulder_damping: {about: 0.0022}
  elbow_damping:
  tie:
offsets: [hand.length]
delay: find
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A record of the arm with its puppet and samples; the commands are columns of the samples."""
    record_folder = tmp_path_factory.mktemp("record")
    (record_folder / "arm.yaml").write_text(PUPPET_YAML, encoding="utf-8")
    (record_folder / "swing.yaml").write_text(RECORD_YAML, encoding="utf-8")
    data = record(arm(), 8.0, 7)
    time_intervals = np.arange(0.0, data.t[0], 0.02), data.t, np.arange(data.t[-1] + 0.02, 8, 0.02)
    t = np.concatenate(time_intervals)
    q_K, _, _ = data.inputs.evaluate(t)
    columns: dict = {"time": t.tolist()}
    for q, name in enumerate(data.marionette.coordinates.q_K):
        columns[name] = q_K[:, q].tolist()
    is_sampled = np.isin(t, data.t)
    for name, values in data.columns.items():
        cells = np.full(len(t), np.nan)
        cells[is_sampled] = values
        cells[200:230] = np.nan
        columns[name] = ["" if np.isnan(x) else repr(float(x)) for x in cells]
    write_table(columns, record_folder / "swing.csv")
    return record_folder


def test_a_record_is_found_and_the_puppet_written(folder, tmp_path):
    out, report = tmp_path / "found.yaml", tmp_path / "found.json"
    command = CliRunner().invoke(
        app, ["identify", str(folder / "swing.yaml"), "--out", str(out), "--report", str(report)]
    )
    assert command.exit_code == 0, command.output
    assert "upper.mass" in command.output and "delay" in command.output
    data = json.loads(report.read_text(encoding="utf-8"))
    low, high = data["numbers"]["upper.mass"]["interval"]
    assert low - 0.004 < 0.16 < high + 0.004
    assert data["doubts"] == []
    text = out.read_text(encoding="utf-8")
    assert "# weighed badly" in text
    marionette = fan.load(out)
    error = abs(marionette.tree.parameters["tie"] + 0.305)
    assert error < 4 * data["numbers"]["tie"]["standard_deviation"] < 4e-3
    assert abs(marionette.mass - 0.1 - data["numbers"]["upper.mass"]["value"]) < 1e-6


def test_the_schema_accepts_valid_records():
    from ruamel.yaml import YAML

    validator = Draft202012Validator(record_schema())
    assert not list(validator.iter_errors(YAML(typ="safe").load(RECORD_YAML)))


MISTAKES = [
    ("body: upper", "body: uper", r"swing\.yaml:5: markers\.middle\.body: .*'upper'"),
    ("upper.mass:", "uper.mass:", r"swing\.yaml:9: unknown\.uper\.mass: "),
    ("upper.mass:", "upper.maas:", r"swing\.yaml:9: .*found no maas; did you mean 'mass'"),
    ("  tie:", "  lower.drag.linear:", r"swing\.yaml:12: .*needed: about"),
    ("  tie:", "  tie:\n  hand.path.0.at.z:", r"swing\.yaml:13: .*the same number as tie; leave"),
    (
        "  elbow_damping:",
        "  elbow.damping:\n  elbow_damping:",
        r"swing\.yaml:12: .*the same number as elbow\.damping",
    ),
    ("[hand.length]", "[hand.lenght]", r"swing\.yaml:13: offsets\[0\]: .*'hand\.length'"),
    ("[hand.length]", "[hand.x, hand.x]", r"swing\.yaml:13: offsets\[1\]: hand\.x is .* twice"),
    ("swing.csv", "swong.csv", r"swing\.yaml:3: samples: "),
    ("puppet: arm.yaml", "puppet: arms3d", r"swing\.yaml:2: puppet: "),
    ("puppet: arm.yaml", "puppet: visit", r"swing\.yaml:2: puppet: .*which is a scene"),
    ("delay: find", "delay: fined", r"swing\.yaml:14: delay: "),
    (
        "delay: find",
        "delay: 2.0",
        r"swing\.yaml:3: samples: the samples, less the delay, last from",
    ),
    ("  middle:", "  centre:", r"swing\.yaml:5: .*none of the columns centre\.x"),
    ("delay: find", "noise: {elbow: 0.1}", r"swing\.yaml:14: noise\.elbow: .*no marker or column"),
    ("delay: find", "start: {elbo: 1}", r"swing\.yaml:14: start\.elbo: "),
    (
        "delay: find",
        "columns: {wrist.x: {coordinate: elbo}}",
        r"swing\.yaml:14: columns\.wrist\.x\.coordinate: .*'elbow'",
    ),
    (
        "delay: find",
        "columns: {wrist.x: {tension: hnd}}",
        r"swing\.yaml:14: columns\.wrist\.x\.tension: .*'hand'",
    ),
    (
        "delay: find",
        "columns: {wrist.x: {unit: deg}}",
        r"swing\.yaml:14: columns\.wrist\.x\.unit: found deg; wrist\.x is in m",
    ),
    (
        "delay: find",
        "columns: {wrist.x: {tension: hand, unit: deg}}",
        r"swing\.yaml:14: .*found deg; hand\.tension is in N",
    ),
    (
        "delay: find",
        "columns: {tip.x: {tension: hand}, tip.y: {tension: hand}}",
        r"swing\.yaml:14: columns\.tip\.y: the columns tip\.x and tip\.y are both hand\.tension",
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES)
def test_mistakes_have_their_place(folder, old, new, message):
    assert old in RECORD_YAML
    path = folder / "swing.yaml"
    path.write_text(RECORD_YAML.replace(old, new, 1), encoding="utf-8")
    try:
        with pytest.raises(FileError, match=message):
            fan.lab.load_record(path)
    finally:
        path.write_text(RECORD_YAML, encoding="utf-8")


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ("0.02", r"found 0\.02 after 0\.04; times must increase"),
        ("0.04", r"found 0\.04 after 0\.04; times must increase"),
        ("", "found no time"),
    ],
)
def test_a_wrong_time_has_its_line(folder, time, message):
    lines = (folder / "swing.csv").read_text(encoding="utf-8").splitlines()
    lines[4] = ",".join([time, *lines[4].split(",")[1:]])
    (folder / "bad.csv").write_text("\n".join(lines), encoding="utf-8")
    (folder / "bad.yaml").write_text(RECORD_YAML.replace("swing.csv", "bad.csv"), encoding="utf-8")
    with pytest.raises(FileError, match=rf"bad\.csv:5: time\[3\]: {message}"):
        fan.lab.load_record(folder / "bad.yaml")


def test_samples_beyond_the_inputs_are_refused(folder):
    (folder / "short.yaml").write_text(
        "coordinates: {hand.length: [[0, 1.0], [5, 0.9]]}\n", encoding="utf-8"
    )
    text = RECORD_YAML.replace("samples:", "inputs: short.yaml\nsamples:")
    (folder / "cut.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=r"cut\.yaml:3: inputs: .* 7\.78.* from 0 s to 5 s"):
        fan.lab.load_record(folder / "cut.yaml")


def test_coordinates_at_rest_are_recognised(folder):
    text = "record: hung\npuppet: arm.yaml\nsamples: hung.csv\nunknown: {tie: }\ndelay: -2.0\n"
    (folder / "hung.yaml").write_text(text, encoding="utf-8")
    rows = "\n".join(f"{0.1 * i:.1f},{0.01 * i:.2f}" for i in range(20))
    (folder / "hung.csv").write_text(f"time,elbow\n{rows}\n", encoding="utf-8")
    data = fan.lab.load_record(folder / "hung.yaml")
    assert set(data.constant_inputs) == {"hand.x", "hand.y", "hand.length"}
    assert fan.lab.load_record(folder / "swing.yaml").constant_inputs == ()


def test_a_place_never_takes_the_name_of_a_parameter(folder):
    text = PUPPET_YAML.replace("mass: 0.1\n", "mass: {parameter: upper_mass, value: 0.1}\n")
    assert text != PUPPET_YAML
    (folder / "clash.yaml").write_text(text, encoding="utf-8")
    (folder / "both.yaml").write_text(
        RECORD_YAML.replace("arm.yaml", "clash.yaml"), encoding="utf-8"
    )
    data = fan.lab.load_record(folder / "both.yaml")
    assert data.unknowns[0].name == "upper_mass_" and data.labels[0] == "upper.mass"
    assert dict(data.marionette.tree.parameters)["upper_mass"] == 0.1


def test_noise_and_units_go_by_the_columns_of_the_file(folder):
    options = """noise: {wrist.x: 0.01, middle: 0.004}
columns: {hand.length: {unit: mm}}
delay: {about: 0.02}
"""
    (folder / "units.yaml").write_text(
        RECORD_YAML.replace("delay: find\n", options), encoding="utf-8"
    )
    in_metres, data = (fan.lab.load_record(folder / f"{name}.yaml") for name in ("swing", "units"))
    assert data.noise == {"wrist.x": 0.01, "middle": 0.004}
    noise = dict(
        zip(data.channels.names, NoiseLevels.from_record(data).given.tolist(), strict=True)
    )
    assert noise["wrist.x"] == 0.01 and np.isnan(noise["wrist.y"]) and noise["middle.z"] == 0.004
    q = data.marionette.coordinates.q_K.index("hand.length")
    lengths = [x.inputs.evaluate(3.0)[0][q] for x in (in_metres, data)]
    assert np.isclose(lengths[1], 1e-3 * lengths[0])
    assert data.find_delay and data.delay == 0.02 and data.initial_values[-1] == 0.02


def test_names_of_twins_have_their_side():
    data = {
        "bodies": [{"name": "hand_left", "mass": 0.1}],
        "mirror": {"plane": "xz", "from": "left", "to": "right"},
    }
    assert find_number(data, "hand_left.mass").value == 0.1
    with pytest.raises(StateError, match="hand_right is the mirror image of hand_left"):
        find_number(data, "hand_right.mass")


BARE_YAML = """\
puppet: bare   # as it was
bodies:
- {name: a, mass: 0.5,   com: [0, 0,   -0.1]}   # kept

-  name: 'b'
   joint: {name: j, type: revolute, axis: [0, 1, 0]}
   mass:   {parameter: m, value: 3e-1}  # and this
-    name: c
"""


def test_a_written_puppet_differs_in_its_numbers_alone(tmp_path):
    data = read_text(BARE_YAML).data
    changes = {
        "a.mass": 0.25,
        "a.com.z": -0.2,
        "m": 0.125,
        "j.damping": 0.01,
        "b.drag.linear": 0.5,
        "b.drag.angular": 1e-5,
        "c.mass": 1.0,
    }
    write_numbers(
        BARE_YAML, {find_number(data, k): x for k, x in changes.items()}, tmp_path / "out.yaml"
    )
    text = (tmp_path / "out.yaml").read_text(encoding="utf-8")
    expected = BARE_YAML.replace("0.5,", "0.25,").replace("-0.1]", "-0.2]").replace("3e-1", "0.125")
    expected = expected.replace("name: j, ", "name: j, damping: 0.01, ")
    expected = expected.replace("   joint:", "   drag: {linear: 0.5, angular: 1e-05}\n   joint:")
    expected = expected.replace("-    name: c", "-    mass: 1\n     name: c")
    assert text == expected


def test_a_number_that_others_share_is_not_written(tmp_path):
    text = "bodies:\n- {name: a, mass: &same 0.5}\n- {name: b, mass: *same}\n"
    number = find_number(read_text(text).data, "b.mass")
    with pytest.raises(StateError, match=r"bodies\.1\.mass in line 2 is .* write the number out"):
        write_numbers(text, {number: 1.0}, tmp_path / "out.yaml")
    assert not list(tmp_path.iterdir())


def test_a_written_marionette_keeps_its_layout(tmp_path):
    source = puppets.path("marionette").read_text(encoding="utf-8")
    data = read_text(source).data
    name, value = next((v["parameter"], v["value"]) for _, v in parameters(data))
    write_numbers(source, {find_number(data, name): 1.25 * value}, tmp_path / "out.yaml")
    text = (tmp_path / "out.yaml").read_text(encoding="utf-8")
    pairs = list(zip(source.splitlines(), text.splitlines(), strict=True))
    changed = [(old, new) for old, new in pairs if old != new]
    assert 0 < len(changed) <= len(find_number(data, name).paths)
    assert all("value" in old and f"{1.25 * value:.7g}" in new for old, new in changed)


def run_identify(*options):
    return CliRunner().invoke(app, ["identify", *map(str, options)])


def test_the_report_is_a_page_or_numbers_by_its_ending(folder, tmp_path):
    page = tmp_path / "found.HTML"
    command = run_identify(folder / "swing.yaml", "--report", page)
    assert command.exit_code == 0, command.output
    text = page.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>") and "<h1>swing</h1>" in text
    assert all(f"<td>{name}</td>" in text for name in ("upper.mass", "tie", "tip.at.z", "wrist.y"))


def test_doubts_have_an_exit_code(folder):
    """All numbers are determined and the search converges, but residuals exceed the noise."""
    path = folder / "quiet.yaml"
    path.write_text(RECORD_YAML + "noise: {wrist.x: 0.0005}\n", encoding="utf-8")
    command = run_identify(path)
    assert "more than the noise given" in command.output
    assert "does not determine" not in command.output and "did not converge" not in command.output
    assert command.exit_code == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--report", "{}/page.pdf"), "allowed: .json, .html"),
        (("--out", "{}/arm.yaml", "--force"), "is a file of the record"),
        (("--out", "{}/swing.yaml"), "is a file of the record"),
        (("--suggest", "{}/swing.csv"), "is a file of the record"),
        (("--out", "{}/old.yaml"), "exists already; use --force"),
        (("--force",), "applies to --out"),
        (("--reach", "0.1"), "applies to --suggest"),
        (("--seed", "1"), "applies to --suggest"),
        (("--suggest", "{}/new.csv", "--duration", "-1"), "greater than or equal to 1"),
    ],
)
def test_outputs_and_options_are_checked_first(folder, options, message):
    (folder / "old.yaml").write_text("mine", encoding="utf-8")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    command = run_identify(folder / "swing.yaml", *(option.format(folder) for option in options))
    assert command.exit_code == 2
    assert message in " ".join(command.output.replace("│", " ").split())
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_a_folder_without_the_meshes_is_refused(tmp_path):
    puppet = {"bodies": [{"shapes": [{"type": "mesh", "file": "shapes/hand.obj"}]}]}
    assert missing_files(puppet, tmp_path) == ("shapes/hand.obj",)
    (tmp_path / "shapes").mkdir()
    (tmp_path / "shapes" / "hand.obj").touch()
    assert missing_files(puppet, tmp_path) == ()


def test_the_next_motion_is_written(folder, tmp_path):
    suggest = tmp_path / "next.csv"
    command = run_identify(
        folder / "swing.yaml", "--suggest", suggest, "--duration", 2, "--seed", 3
    )
    assert command.exit_code == 0, command.output
    assert "Motions" in command.output and "no motion gives" not in command.output
    assert "the inputs do not move" not in command.output
    assert abs(fan.Input.load(arm().puppet, suggest).end - 2.0) < 0.5


def test_uninformative_motions_are_reported(capsys):
    motionless = fan.Input.hold(arm().puppet, 1.0)
    print_motions((fan.lab.identification.Candidate("still", motionless, 0.0, {}, (), np.inf),))
    assert "no motion gives information" in capsys.readouterr().out


def test_a_failed_suggestion_leaves_the_estimate(folder, tmp_path):
    """The string cannot follow these motions: the puppet is written and printed all the same."""
    out = tmp_path / "found.yaml"
    command = run_identify(
        folder / "swing.yaml",
        "--out",
        out,
        "--suggest",
        tmp_path / "next.csv",
        "--duration",
        2,
        "--reach",
        1000,
    )
    assert command.exit_code != 0 and not (tmp_path / "next.csv").exists()
    assert out.exists() and "upper.mass" in command.output


def test_a_wrong_cell_has_its_line(folder):
    lines = (folder / "swing.csv").read_text(encoding="utf-8").splitlines()
    cells = lines[4].split(",")
    cells[-1] = "lots"
    (folder / "bad.csv").write_text("\n".join([*lines[:4], ",".join(cells)]), encoding="utf-8")
    (folder / "bad.yaml").write_text(RECORD_YAML.replace("swing.csv", "bad.csv"), encoding="utf-8")
    with pytest.raises(FileError, match=r"bad\.csv:5: tip\.z\[3\]: found 'lots'; needed: a number"):
        fan.lab.load_record(folder / "bad.yaml")


def test_units_and_names_of_columns(folder):
    text = """\
record: angles
puppet: arm.yaml
samples: angles.csv
inputs: lift.yaml
columns:
  bend: {coordinate: elbow, unit: deg}
  cell: {tension: hand}
unknown: {elbow_damping: }
"""
    (folder / "angles.yaml").write_text(text, encoding="utf-8")
    (folder / "lift.yaml").write_text(
        "coordinates: {hand.length: [[0, 1.0], [1, 0.9]]}\n", encoding="utf-8"
    )
    rows = "\n".join(f"{0.1 * i:.1f},{90 - i},{1.5 if i % 2 else ''}" for i in range(10))
    (folder / "angles.csv").write_text(f"time,bend,cell\n{rows}\n", encoding="utf-8")
    data = fan.lab.load_record(folder / "angles.yaml")
    assert np.isclose(data.columns["elbow"][0], np.pi / 2)
    assert np.isnan(data.columns["hand.tension"][0]) and data.columns["hand.tension"][1] == 1.5


def test_an_empty_last_column_is_left_out(folder):
    """Spreadsheets write a delimiter at the end of each line."""
    lines = (folder / "swing.csv").read_text(encoding="utf-8").splitlines()
    (folder / "trailing.csv").write_text("".join(f"{line},\n" for line in lines), encoding="utf-8")
    text = RECORD_YAML.replace("swing.csv", "trailing.csv")
    (folder / "trailing.yaml").write_text(text, encoding="utf-8")
    assert len(fan.lab.load_record(folder / "trailing.yaml").t) == len(lines) - 1


def test_markers_in_mm_are_suspected():
    data = record(arm(), 2.0, 7)
    axes = {f"{marker.name}.{axis}" for marker in data.markers for axis in "xyz"}
    columns = {name: 1e3 * x if name in axes else x for name, x in data.columns.items()}
    with pytest.raises(StateError, match=r"coordinates of markers are .* are they in mm\?"):
        dataclasses.replace(data, columns=columns)
