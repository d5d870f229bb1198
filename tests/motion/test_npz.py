"""Files (npz) that are damaged, foreign or far too large when expanded."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
from tests.perform.previous_format import previous_format_arrays

import fantoccini as fan
from damage import entries, fuzz, packed, stored
from fantoccini.app.web.page import npz_format
from fantoccini.base import npz
from fantoccini.base.errors import FileError, Mistake
from fantoccini.base.files import replacing
from fantoccini.lab.sweeps.outcome import Outcome
from fantoccini.lab.sweeps.store import Store
from fantoccini.motion import Input, Trajectory
from fantoccini.theatre.perform import Recording

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def files(arm, tmp_path_factory):
    """A file of every kind, and its reader."""
    folder = tmp_path_factory.mktemp("npz")
    x0 = arm.rest({"hand.length": 0.8})
    fan.simulate(arm, x0, t_end=0.05, method="timestepping").save(folder / "run.npz")
    live = fan.Performance(arm, x0)
    live.record()
    live.advance(0.05)
    take = live.stop()
    np.savez(folder / "before.npz", **previous_format_arrays(take, folder / "take.npz"))
    t = np.linspace(0, 1, 40)
    np.savez(folder / "inputs.npz", **{"t": t, "hand.length": 0.8 + 0.01 * np.sin(t)})
    readers = {
        "run": Trajectory.load,
        "take": Recording.load,
        "before": Recording.load,
        "inputs": lambda p: Input.load(arm, p),
    }
    return {name: (folder / f"{name}.npz", load) for name, load in readers.items()}


@pytest.mark.parametrize("kind", ["run", "take", "before", "inputs"])
def test_damage_is_a_located_error(files, kind):
    """Bytes are flipped, ends cut, entries and headers swapped or changed."""
    whole, load = files[kind]
    load(whole)
    assert fuzz(load, whole, 80, seed=7) > 40


@pytest.mark.parametrize("kind", ["run", "take", "inputs"])
def test_a_file_that_expands_without_bound_is_refused(files, kind, tmp_path):
    """A file of 0.3 MB would expand to 300 MB; its size is found without expanding."""
    whole, load = files[kind]
    place = tmp_path / "bomb.npz"
    with zipfile.ZipFile(place, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in entries(whole.read_bytes()).items():
            archive.writestr(name, data)
        with archive.open("more.npy", "w") as file:
            np.lib.format.write_array_header_1_0(
                file, {"descr": "<f8", "fortran_order": False, "shape": (37_500_000,)}
            )
            for _ in range(300):
                file.write(bytes(1_000_000))
    assert place.stat().st_size < 2_000_000
    with pytest.raises(FileError, match=r"bomb\.npz: its arrays need 300 MB; allowed .* 256 MB"):
        load(place)
    assert npz_format(place) == ("", {})


def changed(files, kind: str, tmp_path, change):
    """Result of reading the file with its entries changed."""
    whole, load = files[kind]
    content = entries(whole.read_bytes())
    about = json.loads(npz.read(whole, array_name="about")["about"].tobytes())
    change(content, about)
    content["about.npy"] = stored(np.frombuffer(json.dumps(about).encode(), dtype=np.uint8))
    place = tmp_path / "a.npz"
    place.write_bytes(packed(content))
    return load(place)


@pytest.mark.parametrize(
    "change, message, kind",
    [
        (
            lambda c, a: c.update({"winches.npy": stored(np.array([[5.0, -1.0, 0.0]]))}),
            r"winch of hand: found a largest tension of 5 N, rewinding at -1 m/s",
            "take",
        ),
        (
            lambda c, a: c.update({"winches.npy": stored(np.array([[np.nan, 0.0, 0.0]]))}),
            "winch of hand",
            "take",
        ),
        (lambda c, a: a.update(puppet=3), "puppet is 3; it must be a text", "take"),
        (lambda c, a: a.update(steps=10**12), "found 1000000000000 steps in a tick", "take"),
        (
            lambda c, a: c.update({"checks.npy": stored(np.zeros((2, 3)))}),
            "checks is float64 of the",
            "take",
        ),
        (lambda c, a: c.update({"ticks.npy": stored(np.array([0, 99]))}), "at most 6", "take"),
        (lambda c, a: c.update({"ticks.npy": stored(np.array([3, 6]))}), "increase from 0", "take"),
        (
            lambda c, a: c.update({"events.npy": stored(np.array([[0.0, 77, 0, 0, 0]]))}),
            "an event of the kind 77",
            "before",
        ),
        (
            lambda c, a: c.update({"rows.npy": stored(np.zeros((2, 3)))}),
            "rows is float64 of the",
            "before",
        ),
    ],
)
def test_recordings_are_checked(files, tmp_path, change, message, kind):
    """Recordings with impossible winches, puppets, steps, events and rows are refused."""
    with pytest.raises(FileError, match=rf"a\.npz: is not a recording .*{message}"):
        changed(files, kind, tmp_path, change)


@pytest.mark.parametrize(
    "change, message",
    [
        (
            lambda c, a: c.update({"q_D.npy": stored(np.zeros((26, 2), dtype=complex))}),
            "q_D is complex128",
        ),
        (lambda c, a: c.update({"t.npy": stored(np.full(26, np.nan))}), "t contains a number"),
        (lambda c, a: c.update({"v_K.npy": stored(np.zeros((26, 9)))}), "v_K is float64 of the"),
        (lambda c, a: c.pop("taut.npy"), "taut is missing"),
        (lambda c, a: a["coordinates"].update(scalars_D=[[0, 99], [1, 1]]), "the index 99"),
        (lambda c, a: a.update(puppet=7), "puppet is 7; it must be a text"),
        (lambda c, a: a.update(status="FINE"), "FINE"),
    ],
)
def test_trajectories_are_checked(files, tmp_path, change, message):
    """Shapes and types of arrays, indices and texts are checked."""
    with pytest.raises(FileError, match=rf"a\.npz: is not a trajectory .*{message}"):
        changed(files, "run", tmp_path, change)


def test_errors_of_decoders_are_caught(files, tmp_path):
    """These include LZMAError and tokenize.TokenError."""
    place = tmp_path / "a.npz"
    whole = entries(files["run"][0].read_bytes())
    raw = bytearray(packed(whole, zipfile.ZIP_LZMA))
    start = raw.index(b"t.npy") + len(b"t.npy")
    raw[start : start + 60] = bytes([255]) * 60
    for data in (bytes(raw), packed(whole | {"t.npy": whole["t.npy"].replace(b"(26,)", b"(26( ")})):
        place.write_bytes(data)
        with pytest.raises(FileError, match=r"a\.npz"):
            Trajectory.load(place)


def test_duplicate_entries_are_refused():
    """Many entries are compared at once, not in pairs."""

    def refuse(name: str, text: str) -> FileError:
        return FileError([Mistake("run.npz", None, name, text)])

    class Name(str):
        compared = 0
        __hash__ = str.__hash__

        def __eq__(self, other: object) -> bool:
            Name.compared += 1
            return str.__eq__(self, other)

    names = [Name(f"{i}.npy") for i in range(1000)]
    npz.check_names(names, refuse)
    assert Name.compared < 10 * len(names)
    with pytest.raises(FileError, match="7: exists twice"):
        npz.check_names([*names, "7.npy"], refuse)


def test_headers_must_agree_with_their_entries(tmp_path):
    """A header that claims more data than its entry has takes no memory."""
    place, entry = tmp_path / "a.npz", stored(np.zeros(4))
    place.write_bytes(packed({"q.npy": entry.replace(b"(4,), }      ", b"(4000000000,)}")}))
    with pytest.raises(FileError, match=r"a\.npz: q: is not a plain array: its header says"):
        npz.read(place)
    for array in (np.zeros(0), np.array(3.0), np.asfortranarray(np.eye(3)[:2])):
        np.savez(place, t=array)
        array_in_file = npz.read(place)["t"]
        assert np.array_equal(array_in_file, array) and array_in_file.shape == array.shape


def test_damaged_cases_of_a_sweep_count_as_none(tmp_path):
    """They are computed again."""
    store = Store(tmp_path / "store", {"study": "s"})
    store.write("ab12", Outcome({"height": np.array(1.5)}, 0.1, None), {})
    (place,) = (tmp_path / "store").rglob("ab12.npz")
    whole = place.read_bytes()
    assert store.read("ab12").figures["height"] == 1.5
    cases = []

    def load(path):
        place.write_bytes(path.read_bytes())
        cases.append(store.read("ab12"))

    copy = tmp_path / "whole.npz"
    copy.write_bytes(whole)
    fuzz(load, copy, 60, seed=3)
    assert sum(x is None for x in cases) > 30


def test_a_file_that_is_being_written_is_not_among_those_with_its_ending(tmp_path):
    """A list of a folder's npz files contains only complete ones."""
    with replacing(tmp_path / "run.npz") as part:
        part.write_bytes(b"half")
        assert list(tmp_path.glob("*.npz")) == []
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    with pytest.raises(KeyError), replacing(tmp_path / "run.npz") as part:
        part.write_bytes(b"other")
        raise KeyError
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    assert (tmp_path / "run.npz").read_bytes() == b"half"
