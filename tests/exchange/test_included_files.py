"""Included files of MJCF: their elements keep file and line, and their copies count."""

from __future__ import annotations

import time
from pathlib import Path

import mujoco
import pytest

import fantoccini as fan
from fantoccini.base.errors import ExchangeError
from fantoccini.output.exchange import import_model

MAIN = """<mujoco model="m">
  <include file="parts/first.xml"/>
  <worldbody>
    <body name="a">
      <freejoint/> <include file="parts/inner.xml"/> <geom name="g" size="0.1" rgba="1 0 0 0.5"/>
    </body>
  </worldbody>
  <actuator><motor name="pull" joint="hinge"/></actuator>
</mujoco>"""

FIRST = """<mujocoinclude>
  <!-- two
       lines -->
  <worldbody>
    <body name="b">
      <joint name="hinge" frictionloss="1"/>
      <geom size="0.1"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="push" joint="hinge"/>
  </actuator>
</mujocoinclude>"""

INNER = """<mujoco>
  <body name="c.d">
    <joint type="ball"
      limited="true" range="0 1"/>
    <include file="last.xml"/>
  </body>
</mujoco>"""

LAST = """<mujoco>
  <geom type="sphere" size="0.1"
    rgba="1 1 1 0.5"/>
</mujoco>"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    written(MAIN, FIRST, INNER, LAST)
    return tmp_path


def written(*texts: str) -> None:
    names = ("m.xml", "parts/first.xml", "parts/inner.xml", "parts/last.xml")
    for name, text in zip(names, texts, strict=True):
        Path(name).write_text(text)


def test_notes_name_the_included_file_and_its_line(folder):
    puppet_import = import_model("m.xml")
    assert [f"{n.file}:{n.line}: {n.kind} {n.name}".rstrip() for n in puppet_import.report] == [
        "m.xml:5: geom g",
        "m.xml:8: actuator pull",
        "parts/first.xml:6: joint hinge",
        "parts/first.xml:11: actuator push",
        "parts/inner.xml:2: body c.d",
        "parts/inner.xml:3: joint",
        "parts/last.xml:2: geom",
        "m.xml:None: contact",
    ]
    assert [path.name for path in puppet_import.sources[:4]] == [
        "m.xml",
        "first.xml",
        "inner.xml",
        "last.xml",
    ]
    m = mujoco.MjModel.from_xml_path("m.xml")
    wanted = [m.body(k).name.replace(".", "_") for k in range(1, m.nbody)]
    assert [body.name for body in fan.model.loads(puppet_import.text).bodies] == wanted


WRONG = {
    "a word": ("first", 'frictionloss="1"', 'friction="1"', ":6: ", "unrecognized attribute"),
    "a number": ("last", 'size="0.1"', 'size="-1"', ":2: ", "must be positive"),
    "a name": ("first", 'joint="hinge"', 'joint="hing"', ":11: ", "'hing'"),
    "a puppet's": ("first", 'frictionloss="1"', 'damping="1e12"', ":5: ", "joint.damping: found"),
    "no XML": ("inner", "</body>", "</boy>", ":6: ", "is not XML"),
    "no file": ("inner", "last.xml", "none.xml", ":5: include: ", "found no file 'none.xml'"),
    "a circle": ("last", "<geom", '<include file="inner.xml"/><geom', ":2: ", "included already"),
    "no content": (
        "inner",
        '<include file="last.xml"/>',
        '<include file="../empty.xml"/>',
        ":5: ",
        "'../empty.xml' has no elements",
    ),
    "content": (
        "inner",
        'last.xml"/>',
        'last.xml"><geom size="1"/></include>',
        ":5: include: ",
        "has elements inside",
    ),
    "itself": ("last", "<geom", '<include file="m.xml"/><geom', ":2: ", "included already"),
}


@pytest.mark.parametrize(("name", "old", "new", "line", "text"), WRONG.values(), ids=WRONG)
def test_mistakes_name_the_included_file_and_its_line(folder, name, old, new, line, text):
    path = Path(f"parts/{name}.xml")
    Path("empty.xml").write_text("<mujoco/>")
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ExchangeError) as caught:
        import_model("m.xml")
    (message,) = str(caught.value).splitlines()
    assert message.startswith(f"{path}{line}") and text in message
    assert "line 0" not in message


def test_mistakes_of_the_first_file_keep_their_lines(folder):
    Path("m.xml").write_text(MAIN.replace('size="0.1"', 'size="-1"'))
    with pytest.raises(ExchangeError, match=r"^m\.xml:5: MuJoCo says: .*; Element .*, line 5$"):
        import_model("m.xml")


def test_lines_are_known_where_meshes_are_read(folder):
    """The text for finding lines is read without a folder, so meshes are not looked for."""
    (folder / "x.stl").write_bytes(fan.output.exchange.solids.cylinder_stl())
    asset = '<asset><mesh name="x" file="{}.stl"/></asset>\n<worldbody>'
    text = FIRST.replace("<worldbody>", asset).replace('<geom size="0.1"/>', MESH)
    Path("parts/first.xml").write_text(text.format("x"))
    puppet_import = import_model("m.xml")
    assert list(puppet_import.meshes) == ["m_meshes/x.stl"]
    assert "parts/first.xml:12: actuator push" in "\n".join(map(str, puppet_import.report))
    Path("parts/first.xml").write_text(text.format("none"))
    with pytest.raises(ExchangeError, match=r"^m\.xml: MuJoCo says: .*none\.stl"):
        import_model("m.xml")


MESH = '<geom type="mesh" mesh="x"/>'

GEOM = '<geom size="0.1"/>'

COPIES = {
    "one included": ('<replicate count="20000">' + GEOM + "</replicate>", "parts/last.xml:2"),
    "with a sign": ('<replicate count=" +20000 ">' + GEOM + "</replicate>", "parts/last.xml:2"),
    "within one another": (
        '<replicate count="200"><replicate count="200">' + GEOM + "</replicate></replicate>",
        "parts/last.xml:2",
    ),
    "many small ones": (
        ('<replicate count="10">' + GEOM + "</replicate>") * 2000,
        "parts/last.xml:2",
    ),
    "of bodies": (
        '<replicate count="9000"><body><joint/>' + GEOM * 9 + "</body></replicate>",
        "parts/last.xml:2",
    ),
    "a cable through points": (
        f'<composite type="cable" vertex="{"0 0 0 " * 20000}"/>',
        "parts/last.xml:2",
    ),
    "a cloth of points": (
        f'<flexcomp type="direct" dim="1" point="{"0 0 0 " * 20000}"/>',
        "parts/last.xml:2",
    ),
    "a cloth of a file": ('<flexcomp type="mesh" dim="2" file="x.obj"/>', "parts/last.xml:2"),
    "cloths without a count": ('<flexcomp name="f" dim="3"/>' * 12, "parts/last.xml:2"),
    "of themselves": (
        "".join(
            f'<body name="a{k}">{GEOM}'
            + "".join(f'<attach body="a{k - 1}" prefix="{c}{k}"/>' for c in "xy" if k)
            + "</body>"
            for k in range(25)
        ),
        "parts/last.xml:2",
    ),
    "of frames": (
        "".join(
            f'<frame name="a{k}">{GEOM}'
            + "".join(f'<attach frame="a{k - 1}" prefix="{c}{k}"/>' for c in "xy" if k)
            + "</frame>"
            for k in range(25)
        ),
        "parts/last.xml:2",
    ),
    "of copies": (
        f'<body name="a">{GEOM}</body>'
        + "".join(
            f'<frame><attach body="{"x" * k}a" prefix="x"/><attach body="world" prefix="y{k}"/>'
            "</frame>"
            for k in range(25)
        ),
        "parts/last.xml:2",
    ),
    "a cable": ('<composite type="cable" count="20000 1 1"/>', "parts/last.xml:2"),
}


@pytest.mark.parametrize(("inside", "place"), COPIES.values(), ids=COPIES)
def test_too_many_copies_are_refused_in_seconds(folder, inside, place):
    Path("parts/last.xml").write_text(f"<mujoco>\n{inside}{GEOM}</mujoco>")
    Path("x.obj").write_text("v 0.123 0.456 0.789\n" * 50_000)
    before = time.monotonic()
    with pytest.raises(ExchangeError, match=r"copies( its content|,)") as caught:
        import_model("m.xml")
    assert time.monotonic() - before < 5.0
    assert str(caught.value).startswith(f"{place}: ")


def test_copies_of_an_included_file_count_in_the_first(folder):
    Path("parts/last.xml").write_text(f'<mujoco><replicate count="200">{GEOM}</replicate></mujoco>')
    whole = '<include file="parts/inner.xml"/>'
    Path("m.xml").write_text(MAIN.replace(whole, f'<replicate count="200">{whole}</replicate>'))
    with pytest.raises(ExchangeError, match=r"last\.xml:1: replicate: copies its content 40000"):
        import_model("m.xml")


ATTACHED = """<mujoco><asset><model name="x" file="{0}.xml"/></asset><worldbody><body name="b">
<joint/><geom size="0.1"/></body><replicate count="{1}" offset="1 0 0"><attach model="x" body="b"
prefix="p"/></replicate></worldbody></mujoco>"""


def test_models_within_models_end(folder):
    """MuJoCo ends with a segmentation fault if they do not."""
    Path("x.xml").write_text(ATTACHED.format("x", 1))
    with pytest.raises(ExchangeError, match=r"^x\.xml:1: model: 'x\.xml' contains itself"):
        import_model("x.xml")
    for k in range(4):
        Path(f"x{k}.xml").write_text(ATTACHED.format(f"x{k + 1}", 100))
    plain = '<body name="b"><joint/><geom size="1"/></body>'
    Path("x4.xml").write_text(f"<mujoco><worldbody>{plain}</worldbody></mujoco>")
    with pytest.raises(ExchangeError, match="longer than about ten seconds"):
        import_model("x0.xml")
    assert len(import_model("x3.xml").joints) == 101


def test_a_few_copies_are_imported(folder):
    Path("parts/last.xml").write_text(f'<mujoco><replicate count="3">{GEOM}</replicate></mujoco>')
    puppet_import = import_model("m.xml")
    (shapes,) = (b.shapes for b in fan.model.loads(puppet_import.text).bodies if b.name == "c_d")
    assert len(shapes) == 3


def test_lines_of_attached_models_are_not_mistaken_for_those_of_the_file(folder):
    body = '<body name="b">\n<joint frictionloss="1"/><geom size="0.1"/></body>'
    Path("y.xml").write_text(f"<mujoco><worldbody>\n{body}</worldbody></mujoco>")
    Path("x.xml").write_text(ATTACHED.format("y", 1).replace("<joint/>", "\n\n<joint/>", 1))
    (joint, contact) = import_model("x.xml").report
    assert str(joint) == "x.xml: joint: has frictionloss, left out" and contact.kind == "contact"
    Path("x.xml").write_text(ATTACHED.format("y", 1).replace("<joint/>", JOINT))
    notes = [(n.kind, n.line) for n in import_model("x.xml").report]
    assert notes == [("joint", 4), ("joint", None), ("contact", None)]


JOINT = '\n\n<joint frictionloss="1"/>'


@pytest.mark.parametrize("name", ["m.xml", "parts/last.xml"])
def test_another_encoding_is_reported(folder, name):
    text = '<?xml version="1.0" encoding="latin-1"?>\n<mujoco>\n<!-- \xe9 --></mujoco>'
    Path(name).write_bytes(text.encode("latin-1"))
    with pytest.raises(ExchangeError, match=rf"^{name}:3: is not UTF-8"):
        import_model("m.xml")


def test_lines_are_known_beside_cdata_and_flexible_bodies(folder):
    """MuJoCo reads both when it reads the text, not when it compiles the model."""
    flex = '<flexcomp name="f" type="mesh" dim="2" mass="1" file="x.obj"/>'
    world = f'<compiler meshdir="meshes"/><worldbody><body name="q">{flex}</body>'
    first = FIRST.replace("<worldbody>", world)
    custom = '<custom><text name="t"><![CDATA[<b>\n]]></text></custom>\n</mujoco>'
    written(MAIN.replace("</mujoco>", custom), first, INNER, LAST)
    (folder / "meshes" / "parts").mkdir(parents=True)
    (folder / "meshes" / "parts" / "x.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    notes = [f"{n.file}:{n.line}: {n.kind}" for n in import_model("m.xml").report]
    assert {
        "m.xml:8: actuator",
        "parts/first.xml:11: actuator",
        "parts/first.xml:6: joint",
        "parts/last.xml:2: geom",
    } <= set(notes)


IN_ATTACHED = {
    "a word": ("<joint/>", '<joint\nkind="ball"/>', ":2: ", "unrecognized attribute: 'kind'"),
    "a number": ('size="0.1"', '\nsize="-1"', ":2: ", "must be positive"),
    "no XML": ("</body>", "\n</boy>", ":3: ", "is not XML"),
    "of its parts": (
        "<joint/>",
        '\n<include file="z.xml"/>',
        "parts/z.xml:2: ",
        "must be positive",
    ),
}


@pytest.mark.parametrize(("old", "new", "line", "text"), IN_ATTACHED.values(), ids=IN_ATTACHED)
def test_mistakes_in_attached_models_name_their_file_and_line(folder, old, new, line, text):
    Path("parts/z.xml").write_text('<mujoco>\n<geom size="-1"/></mujoco>')
    body = '<body name="b">\n<joint/><geom size="0.1"/></body>'.replace(old, new)
    Path("parts/y.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    Path("x.xml").write_text(ATTACHED.format("parts/y", 1))
    with pytest.raises(ExchangeError) as caught:
        import_model("x.xml")
    (message,) = str(caught.value).splitlines()
    place = f"parts/y.xml{line}" if line[0] == ":" else line
    assert place in message and text in message


def test_a_mistake_in_both_models_is_reported_for_the_file(folder):
    """MuJoCo does not read the unattached part of the model."""
    more = '<body name="c"><joint/>\n<geom size="-1"/></body>'
    body = '<body name="b"><joint/><geom size="0.1"/></body>'
    Path("y.xml").write_text(f"<mujoco><worldbody>{body}{more}</worldbody></mujoco>")
    text = ATTACHED.format("y", 1).replace("<replicate", "\n\n{}<replicate", 1)
    Path("x.xml").write_text(text.format('<geom size="-1"/>'))
    with pytest.raises(ExchangeError, match=r"^x\.xml:4: MuJoCo says: .*must be positive"):
        import_model("x.xml")
    Path("x.xml").write_text(text.format(""))
    assert len(import_model("x.xml").joints) == 2


def test_files_of_attached_models_are_kept(folder):
    for name in ("parts/a_meshes", "a_meshes"):
        Path(name).mkdir()
    mesh = fan.output.exchange.solids.cylinder_stl()
    Path("parts/y.xml").write_text(
        '<mujoco><compiler meshdir="a_meshes"/><include file="z.xml"/><worldbody><body name="b">'
        '<joint/><geom type="mesh" mesh="part"/></body></worldbody></mujoco>'
    )
    Path("parts/z.xml").write_text('<mujoco><asset><mesh file="part.stl"/></asset></mujoco>')
    Path("parts/a_meshes/part.stl").write_bytes(mesh)
    Path("x.xml").write_text(ATTACHED.format("parts/y", 1))
    puppet_import = import_model("x.xml")
    read = {path.resolve() for path in puppet_import.sources if path.exists()}
    assert read == {
        folder / name for name in ("x.xml", "parts/y.xml", "parts/z.xml", "parts/a_meshes/part.stl")
    }
    with pytest.raises(ExchangeError, match=r"y\.xml: is part of the model"):
        puppet_import.save("parts/y.xml", force=True)
