"""Record files: what they mean, and where their mistakes are."""

from __future__ import annotations

import json

import numpy as np
import pytest
from benchmarks.identify.cases import ARM, arm, record
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

import fantoccini as fan
from fantoccini.cli.app import app
from fantoccini.errors import FileError
from fantoccini.files import write_table
from fantoccini.identification import record_schema

PLAIN = ARM.replace("{parameter: upper_mass, value: 0.13}", "0.13 # weighed badly").replace(
    "{parameter: lower_mass, value: 0.12}", "0.1"
)
TEXT = """\
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
    place = tmp_path_factory.mktemp("record")
    (place / "arm.yaml").write_text(PLAIN, encoding="utf-8")
    (place / "swing.yaml").write_text(TEXT, encoding="utf-8")
    one = record(arm(), 8.0, 7)
    around = np.arange(0.0, one.t[0], 0.02), one.t, np.arange(one.t[-1] + 0.02, 8, 0.02)
    t = np.concatenate(around)
    q_K, _, _ = one.inputs.evaluate(t)
    columns: dict = {"time": t.tolist()}
    for q, name in enumerate(one.marionette.coordinates.q_K):
        columns[name] = q_K[:, q].tolist()
    inside = np.isin(t, one.t)
    for name, values in one.columns.items():
        cells = np.full(len(t), np.nan)
        cells[inside] = values
        cells[200:230] = np.nan
        columns[name] = ["" if np.isnan(x) else repr(float(x)) for x in cells]
    write_table(columns, place / "swing.csv")
    return place


def test_a_record_is_found_and_the_puppet_written(folder, tmp_path):
    out, report = tmp_path / "found.yaml", tmp_path / "found.json"
    done = CliRunner().invoke(
        app, ["identify", str(folder / "swing.yaml"), "--out", str(out), "--report", str(report)]
    )
    assert done.exit_code == 0, done.output
    assert "upper.mass" in done.output and "delay" in done.output
    data = json.loads(report.read_text(encoding="utf-8"))
    low, high = data["numbers"]["upper.mass"]["interval"]
    assert low - 0.004 < 0.16 < high + 0.004
    text = out.read_text(encoding="utf-8")
    assert "# weighed badly" in text
    found = fan.load(out)
    apart = abs(found.tree.parameters["tie"] + 0.305)
    assert apart < 4 * data["numbers"]["tie"]["standard_deviation"] < 4e-3
    assert abs(found.mass - 0.1 - data["numbers"]["upper.mass"]["value"]) < 1e-6


def test_the_schema_takes_what_is_read():
    from ruamel.yaml import YAML

    validator = Draft202012Validator(record_schema())
    assert not list(validator.iter_errors(YAML(typ="safe").load(TEXT)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("body: upper", "body: uper", "swing.yaml:5: "),
        ("upper.mass:", "uper.mass:", "swing.yaml:9: unknown.uper.mass: "),
        ("upper.mass:", "upper.maas:", "found no maas; did you mean 'mass'"),
        ("  tie:", "  lower.drag.linear:", "needed: about"),
        ("offsets: [hand.length]", "offsets: [hand.lenght]", "did you mean 'hand.length'"),
        ("swing.csv", "swong.csv", "swing.yaml:3: samples: "),
        ("puppet: arm.yaml", "puppet: arms3d", "swing.yaml:2: puppet: "),
        ("delay: find", "delay: fined", "delay"),
        ("  middle:", "  centre:", "none of the columns centre.x"),
        ("record: swing", "record: swing\nnoise: {elbow: 0.1}", "elbow"),
    ],
)
def test_mistakes_have_their_place(folder, old, new, message):
    assert old in TEXT
    path = folder / "swing.yaml"
    path.write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    try:
        with pytest.raises((FileError, fan.FantocciniError)) as error:
            fan.load_record(path)
        assert message in str(error.value)
    finally:
        path.write_text(TEXT, encoding="utf-8")


def test_a_wrong_cell_has_its_line(folder):
    lines = (folder / "swing.csv").read_text(encoding="utf-8").splitlines()
    cells = lines[4].split(",")
    cells[-1] = "lots"
    (folder / "bad.csv").write_text("\n".join([*lines[:4], ",".join(cells)]), encoding="utf-8")
    (folder / "bad.yaml").write_text(TEXT.replace("swing.csv", "bad.csv"), encoding="utf-8")
    with pytest.raises(FileError, match=r"bad\.csv:5: tip\.z: found 'lots'; needed: a number"):
        fan.load_record(folder / "bad.yaml")


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
    one = fan.load_record(folder / "angles.yaml")
    assert np.isclose(one.columns["elbow"][0], np.pi / 2)
    assert np.isnan(one.columns["hand.tension"][0]) and one.columns["hand.tension"][1] == 1.5
