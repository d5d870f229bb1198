"""Input files equal inputs in Python, and every mistake has its line."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from fantoccini.base import rotation
from fantoccini.base.errors import InputError
from fantoccini.motion import Input, inputs_schema
from fantoccini.motion.archive import RECORDING_FORMAT

pytestmark = pytest.mark.own_puppets

GOOD = """\
# a greeting
name: greeting
duration: 4
coordinates:
  hand.length: [[0, 0.8], [1.5, 0.5]]
  crank:
    - [0, 0]
    - [1, 90 deg]
  bar.rotation: [[0, [1, 0, 0, 0]], [2, [0, 0, 0.5]]]
forces:
  elbow: [[0.25, 0], [1, 2]]
"""


def are_equal(first: Input, second: Input) -> bool:
    return all(
        np.array_equal(getattr(first, name), getattr(second, name), equal_nan=True)
        for name in ("breaks", "coef", "base")
    ) and np.array_equal(first.named, second.named)


def test_yaml_equals_python(table, tmp_path):
    path = tmp_path / "greet.yaml"
    path.write_text(GOOD)
    read = Input.load(table, path)
    inputs = (
        Input.waypoints(
            table,
            {
                "hand.length": [(0, 0.8), (1.5, 0.5)],
                "crank": [(0, 0), (1, np.pi / 2)],
                "bar.rotation": [(0, [1, 0, 0, 0]), (2, [0, 0, 0.5])],
            },
        )
        .with_forces({"elbow": [(0.25, 0), (1, 2)]})
        .with_rest_until(4.0)
    )
    assert are_equal(read, inputs)
    assert np.array_equal(read.force, inputs.force)
    assert read.end == 4.0 and read.name == "greeting"


@pytest.mark.parametrize(("first", "start"), [(1.0, 0.0), (0.0, 0.0), (-0.5, -0.5)])
def test_waypoints_in_a_file_begin_at_0_and_hold_until_the_first(table, tmp_path, first, start):
    """Runs begin at 0, not at the time of the first waypoint."""
    path = tmp_path / "late.yaml"
    path.write_text(f"""\
coordinates:
  hand.length: [[{first}, 0.8], [2.5, 0.5]]
  bar.rotation: [[{first}, [0, 0, 0.3]], [2, [0, 0, 0.5]]]
forces:
  elbow: [[1.5, 0], [1.75, 2]]
""")
    read = Input.load(table, path)
    assert (read.start, read.end) == (start, 2.5)
    before = np.linspace(start, first, 5)
    q_K, v_K, acc_K = read.evaluate(before)
    assert np.allclose(q_K, read.evaluate(first)[0], atol=1e-15)
    assert not np.any(v_K) and not np.any(acc_K[:-1])
    assert not np.any(read.evaluate_force(before))
    assert np.allclose(read.evaluate_force(1.625).max(), 1.0)
    # Recorded samples begin at the recorder's clock.
    (tmp_path / "late.csv").write_text("t,hand.length\n1,0.8\n2,0.7\n")
    assert Input.load(table, tmp_path / "late.csv").start == 1.0


def test_a_negative_final_length_is_reported_with_all_other_mistakes(table, tmp_path):
    """All mistakes are reported at once, even when one value is out of range."""
    path = tmp_path / "bad.yaml"
    path.write_text("""\
coordinates:
  hand.length: [[0, 0.8], [1, -0.5]]
  crank: [[0, ten]]
""")
    with pytest.raises(InputError) as caught:
        Input.load(table, path)
    assert [p.line for p in caught.value.mistakes] == [2, 3]


def test_samples_from_csv_and_npz_are_those_from_python(table, tmp_path):
    t = np.linspace(0, 2, 30)
    q = rotation.exp(np.outer(np.sin(t), [0.3, 0.2, 0.1]))
    columns = {"hand.length": 1 + 0.1 * np.cos(t), **dict(zip(table.q_K[4:8], q.T, strict=True))}
    inputs = Input.samples(table, t, columns)
    np.savez(tmp_path / "a.npz", t=t, **columns)
    assert are_equal(Input.load(table, tmp_path / "a.npz"), inputs)
    rows = np.column_stack([t, *columns.values()])
    text = "\n".join([",".join(["t", *columns]), *(",".join(map(repr, r)) for r in rows.tolist())])
    (tmp_path / "a.csv").write_text(text + "\n")
    assert are_equal(Input.load(table, tmp_path / "a.csv"), inputs)


SEPARATED = {
    "semicolons": "t;hand.length;crank\n0;0.8;0\n0.5;0.75;-0.1\n1;0.7;1e-2\n",
    "decimal commas": "t;hand.length;crank\n0;0,8;0\n0,5;,75;-0,1\n1,0;0,7;1,0E-2\n",
    "quoted": '"t";"hand.length";"crank"\n"0";"0,8";0\n"0,5";"0,75";"-0,1"\n1;"0,7";"1e-2"\n',
    "blanks": " t ; hand.length ; crank \n 0 ; 0,8 ; 0 \n\n 0,5 ; 0,75 ; -0,1 \n1;0,7 ; 1e-2\n",
    "CR LF and a mark": "\ufefft;hand.length;crank\r\n0;0,8;0\r\n0,5;0,75;-0,1\r\n1;0,7;0,01\r\n",
    "Excel's first line": "sep=;\nt;hand.length;crank\n0;0,8;0\n0,5;0,75;-0,1\n1;0,7;0,01\n",
    "and quoted": '"SEP=,"\r\nt,hand.length,crank\r\n0,0.8,0\r\n0.5,0.75,-0.1\r\n1,0.7,0.01\r\n',
    "ends of lines": "t;hand.length;crank;\n0;0,8;0;\n0,5;0,75;-0,1;;\n1;0,7;0,01\n;;;\n",
    "tabs": "t\thand.length\tcrank\n0\t0,8\t0\n0.5\t0.75\t-0,1\n1\t0.7\t1e-2\n",
}


@pytest.mark.parametrize("text", SEPARATED.values(), ids=SEPARATED)
def test_columns_may_be_separated_by_semicolons_or_tabs_with_decimal_commas(table, tmp_path, text):
    columns = {"hand.length": [0.8, 0.75, 0.7], "crank": [0.0, -0.1, 0.01]}
    (tmp_path / "a.csv").write_text(text, newline="")
    samples = Input.samples(table, [0, 0.5, 1], columns)
    assert are_equal(Input.load(table, tmp_path / "a.csv"), samples)
    (tmp_path / "b.csv").write_text(text.removeprefix("\ufeff"), encoding="utf-16", newline="")
    assert are_equal(Input.load(table, tmp_path / "b.csv"), samples)  # "Unicode text" of Excel


def test_schema_is_json_and_closed():
    schema = json.loads(json.dumps(inputs_schema()))
    assert schema["additionalProperties"] is False
    assert set(schema["properties"]) == {"name", "duration", "coordinates", "forces"}


YAML = {
    "nan": ("coordinates:\n  crank:\n  - [0, .nan]\n", 3, "crank[0]", "found nan"),
    "unknown name": ("coordinates:\n  hand.lenght: [[0, 1]]\n", 2, "hand.lenght", "'hand.length'"),
    "unsorted": ("coordinates:\n  crank:\n  - [0, 1]\n  - [0, 2]\n", 4, "crank[1]", "step"),
    "unknown key": ("coordinates: {}\nwaypoint: 3\n", 2, "waypoint", "not known"),
    "no mapping": ("coordinates:\n  - 3\n", 1, "coordinates", "needed: a mapping"),
    "a list": ("- 3\n", 1, "", "mapping"),
    "empty": ("", 1, "", "empty"),
    "comment only": ("# nothing\n", 1, "", "empty"),
    "syntax": ("coordinates: {a: [\n", 2, "", "not YAML"),
    "half a turn": (
        "coordinates:\n  bar.rotation:\n  - [0, [1, 0, 0, 0]]\n  - [1, [0, 1, 0, 0]]\n",
        4,
        "bar.rotation[1]",
        "180 deg",
    ),
    "zero quaternion": (
        "coordinates:\n  bar.rotation: [[0, [0, 0, 0, 0]]]\n",
        2,
        "bar.rotation[0]",
        "zero quaternion",
    ),
    "length": (
        "coordinates:\n  crank: [[0, 1]]\n  hand.length: [[0, 1], [1, 0]]\n",
        3,
        "hand.length",
        "above 0",
    ),
    "duration": ("duration: 1\ncoordinates: {crank: [[0, 1], [2, 2]]}\n", 1, "duration", "before"),
    "negative duration": ("duration: -1\n", 1, "duration", "positive"),
    "a time too large for a float": (
        f"coordinates:\n  crank: [[0, 1], [1{'0' * 400}, 2]]\n",
        2,
        "crank[1]",
        "up to 1e+09",
    ),
    "a value too large for a float": (
        f"coordinates:\n  crank: [[0, 1], [1, -1{'0' * 400}]]\n",
        2,
        "crank[1]",
        "up to 1e+09",
    ),
    "a number of 5000 digits": (
        f"coordinates:\n  crank: [[0, 1], [1{'0' * 5000}, 2]]\n",
        2,
        "",
        "",
    ),
    "a force too large for a float": (
        f"forces:\n  elbow: [[1{'0' * 400}, 1]]\n",
        2,
        "elbow[0]",
        "up to 1e+09",
    ),
    "a duration too large for a float": (f"duration: 1{'0' * 400}\n", 1, "duration", "finite"),
    "force": ("forces:\n  elbo: [[0, 1]]\n", 2, "forces.elbo", "'elbow'"),
    "force of text": ("forces:\n  elbow: [[0, much]]\n", 2, "elbow[0]", "'much'"),
    "evil name": ('coordinates:\n  "a\\n*/; rm": [[0, 1]]\n', 2, "coordinates", "not a driven"),
    "twice": ("coordinates:\n  crank: [[0, 1]]\n  crank: [[0, 1]]\n", 3, "crank", "twice"),
    "a word": ("coordinates:\n  crank: up\n", 2, "crank", "'up'"),
}


def problems(table, path) -> list:
    with pytest.raises(InputError) as error:
        Input.load(table, path)
    assert all(p.file == str(path) for p in error.value.mistakes)
    return list(error.value.mistakes)


@pytest.mark.parametrize("case", YAML)
def test_mistakes_in_yaml_have_a_line(table, tmp_path, case):
    text, line, key, message = YAML[case]
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    (problem,) = problems(table, path)
    assert (problem.line, key in problem.key) == (line, True)
    assert message in problem.message
    assert "\n" not in str(problem)


def test_all_mistakes_in_yaml_come_at_once(table, tmp_path):
    path = tmp_path / "bad.yaml"
    path.write_text("coordinates:\n  crank: [[0, a], [0, 1]]\n  nose: []\nforces:\n  x: [[0, 1]]\n")
    assert [p.line for p in problems(table, path)] == [2, 2, 3, 5]


CSV = {
    "empty": ("", 1, "", "empty"),
    "no t": ("crank\n1\n", 1, "", "column t"),
    "no rows": ("t,crank\n", 1, "t", "no samples"),
    "text": ("t,crank\n0,1\n1,up\n", 3, "crank", "'up'"),
    "nan": ("t,crank\n0,1\n1,nan\n", 3, "crank", "nan"),
    "unknown": ("t,crnak\n0,1\n", 1, "crnak", "'crank'"),
    "unsorted": ("t,crank\n0,1\n\n2,1\n1,1\n", 5, "t", "must increase"),
    "columns": ("t,crank\n0,1\n1,1,1\n", 3, "", "found 3 columns; the header has 2"),
    "decimal commas": ("t,crank\n0,5,1,5\n", 2, "", "a decimal point, or put ; between columns"),
    "thousands": ("t;crank\n0;1.000,5\n", 2, "crank", "'1.000,5'"),
    "both": ("t;crank\n0;1,000.5\n", 2, "crank", "'1,000.5'"),
    "semicolons and no number": ("t;crank\n0;up\n", 2, "crank", "'up'"),
    "twice": ("t,crank,crank\n0,1,1\n", 1, "crank", "two columns"),
    "unnamed": ("t,\n0,1\n", 1, "", "no name"),
    "part of a rotation": ("t,bar.qw\n0,1\n", 1, "bar.qw", "bar.qx, bar.qy, bar.qz"),
    "zero quaternion": (
        "t,bar.qw,bar.qx,bar.qy,bar.qz\n0,1,0,0,0\n1,0,0,0,0\n",
        3,
        "bar.rotation",
        "zero quaternion",
    ),
    "length": ("t,hand.length\n0,1\n1,-1\n", 1, "hand.length", "above 0"),
    "quote": ('t,crank\n0,"1\n', None, "", "not CSV"),
}


@pytest.mark.parametrize("case", CSV)
def test_mistakes_in_csv_have_a_line(table, tmp_path, case):
    text, line, key, message = CSV[case]
    path = tmp_path / "bad.csv"
    path.write_text(text)
    problem = problems(table, path)[0]
    assert line is None or problem.line == line
    assert key in problem.key and message in problem.message


@pytest.mark.parametrize("ending", ["yaml", "csv", "npz"])
def test_junk_is_refused(table, tmp_path, ending):
    path = tmp_path / f"bad.{ending}"
    path.write_bytes(bytes(range(256)) * 40)
    assert problems(table, path)
    path.write_bytes(b"\0" * 5000)
    assert problems(table, path)


@pytest.mark.parametrize("ending", ["yaml", "csv", "npz", "txt"])
def test_missing_files_folders_and_other_endings(table, tmp_path, ending):
    assert problems(table, tmp_path / f"none.{ending}")
    (tmp_path / f"folder.{ending}").mkdir()
    assert problems(table, tmp_path / f"folder.{ending}")


def test_ten_megabytes_of_yaml(table, tmp_path):
    path = tmp_path / "big.yaml"
    path.write_bytes(b"coordinates:\n  crank: [" + b"[0, 1], " * 1_300_000 + b"]\n")
    (problem,) = problems(table, path)
    assert "MB" in problem.message


def test_aliases_that_explode(table, tmp_path):
    path = tmp_path / "bomb.yaml"
    lines = ["a: &a [0, 0, 0, 0, 0, 0, 0, 0, 0]"]
    for anchor, two in zip("abcdefgh", "bcdefghi", strict=True):
        lines.append(f"{two}: &{two} [{', '.join(['*' + anchor] * 9)}]")
    path.write_text("\n".join(lines))
    assert problems(table, path)


def test_npz_with_objects_or_wrong_shapes(table, tmp_path):
    path = tmp_path / "bad.npz"
    np.savez(path, t=np.arange(3.0), crank=np.array([1, None, 2], dtype=object))
    (problem,) = problems(table, path)
    assert problem.key == "crank" and "holds object" in problem.message
    np.savez(path, t=np.arange(3.0), crank=np.zeros((3, 2)), nose=np.zeros(3))
    assert {p.key for p in problems(table, path)} == {"crank", "nose"}
    np.savez(path, t=np.arange(3.0), crank=np.array(["a", "b", "c"]))
    assert problems(table, path)[0].key == "crank"
    np.savez(path, t=3.0, crank=np.zeros(3))
    assert problems(table, path)


@pytest.mark.parametrize("ending", ["csv", "npz", "yaml"])
def test_a_name_that_no_file_can_have(table, ending):
    for name in ("n" * 300, "a\0b"):
        with pytest.raises(InputError, match=r"cannot be read|found nothing|not an npz"):
            Input.load(table, f"{name}.{ending}")


@pytest.mark.parametrize("duration", [10**400, "1", None, 1 + 0j, -1, float("nan")])
def test_an_invalid_duration_is_refused(table, duration):
    with pytest.raises(InputError, match="duration"):
        Input.hold(table, duration)


def test_a_number_beyond_floats_is_refused(table):
    for bad in (10**400, -(10**400), 10**5000, 1 + 2j, np.complex128(1.0), np.bool_(True)):
        for pair in ((bad, 1.0), (1.0, bad)):
            with pytest.raises(InputError, match="needed: a"):
                Input.waypoints(table, {"crank": [(0.0, 0.0), pair]})


def recording_arrays(table, **changes) -> dict:
    """Arrays of a recording's file for `numpy.savez`; None omits one."""
    about = {"format": RECORDING_FORMAT, "coordinates": [*table.q_D, *table.q_K]}
    about |= changes.pop("about", {})
    arrays = {
        "start_q_K": np.where(np.arange(10) == 0, 0.8, table.start_K),
        "start_v_K": np.zeros(table.n_vK),
        "acc_K": np.zeros((5, table.n_vK)),
        "t": np.array(0.0),
        "tick": np.array(0.01),
        "about": np.frombuffer(json.dumps(about).encode(), dtype=np.uint8),
    } | changes
    return {name: value for name, value in arrays.items() if value is not None}


DAMAGED = {
    "numbers for names": {"about": {"coordinates": [1, 2, 3]}},
    "a number for names": {"about": {"coordinates": 7}},
    "nothing for names": {"about": {"coordinates": None}},
    "a text for names": {"about": {"coordinates": "hand"}},
    "names of names": {"about": {"coordinates": [["a"]] * 10}},
    "no format": {"about": {"format": None}},
    "a list": {"about": np.frombuffer(b"[1, 2]", dtype=np.uint8)},
    "no JSON": {"about": np.frombuffer(b"{", dtype=np.uint8)},
    "texts for numbers": {"acc_K": np.full((5, 10), "a")},
    "texts for the start": {"start_q_K": np.full(10, "a")},
    "a text for a time": {"tick": np.array("a")},
    "complex": {"acc_K": np.zeros((5, 9), dtype=complex)},
    "a number for the start": {"start_q_K": np.array(1.0)},
    "a number for accelerations": {"acc_K": np.array(1.0)},
    "three axes": {"acc_K": np.zeros((5, 9, 2))},
    "no start": {"start_v_K": None},
    "no time": {"t": None},
    "several times": {"t": np.zeros(3)},
    "no ticks": {"acc_K": np.zeros((0, 9))},
    "nan": {"acc_K": np.full((5, 9), np.nan)},
    "huge": {"acc_K": np.full((5, 9), 1e300)},
    "an endless tick": {"tick": np.array(1e308)},
    "a tick of 0": {"tick": np.array(0.0)},
    "a tick too short for its time": {"t": np.array(1e8), "tick": np.array(1e-12)},
    "flags": {"start_v_K": np.zeros(9, dtype=bool)},
}


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_recording_is_one_mistake(table, tmp_path, case):
    path, changes = tmp_path / "recording.npz", dict(DAMAGED[case])
    description = changes.get("about")
    arrays = recording_arrays(
        table, **{**changes, "about": description if isinstance(description, dict) else {}}
    )
    if isinstance(description, np.ndarray):
        arrays["about"] = description
    np.savez(path, **arrays)
    (problem,) = problems(table, path)
    assert problem.message
    np.savez(path, **recording_arrays(table))
    assert Input.load(table, path).end == pytest.approx(0.05)


def test_a_damaged_npz_is_refused_or_read_but_never_a_crash(table, tmp_path):
    whole, path = io.BytesIO(), tmp_path / "bad.npz"
    np.savez_compressed(whole, t=np.arange(30.0), crank=np.sin(np.arange(30.0)))
    rng = np.random.default_rng(5)
    for _ in range(150):
        raw = bytearray(whole.getvalue())
        for place in rng.integers(len(raw), size=3):
            raw[place] = rng.integers(256)
        path.write_bytes(raw[: rng.integers(len(raw) // 2, len(raw) + 1)])
        try:
            Input.load(table, path)
        except InputError:
            continue


def test_a_damaged_csv_is_refused_or_read_but_never_a_crash(table, tmp_path):
    path = tmp_path / "bad.csv"
    text = b"t,crank,hand.length\n" + b"".join(b"%d,0.5,1.25\n" % i for i in range(9))
    rng = np.random.default_rng(5)
    for _ in range(200):
        raw = bytearray(text)
        for place in rng.integers(len(raw), size=2):
            raw[place] = rng.integers(256)
        path.write_bytes(raw)
        try:
            Input.load(table, path)
        except InputError:
            continue
