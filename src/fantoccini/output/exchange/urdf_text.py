"""Cleaning of URDF: links, joints and materials in a form that yourdfpy can read."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

from fantoccini.output.exchange.model_file import XACRO, Element, ModelFile

SOLIDS = frozenset({"box", "capsule", "cylinder", "mesh", "sphere"})
"""Solids of a geometry."""


@dataclass
class UrdfText:
    """Links, joints and materials of a file.

    Attributes:
        text: XML, with capsules written as cylinders, which yourdfpy can read.
        capsules: link, ``visual`` or ``collision``, and the index of each capsule among these.
        left_out: link, message and line of each element left out of the text.
    """

    text: bytes = b""
    capsules: set[tuple[str, str, int]] = field(default_factory=set)
    left_out: list[tuple[str, str, int]] = field(default_factory=list)


@dataclass
class _Node:
    element: Element
    children: list[_Node] = field(default_factory=list)

    def named(self, *tags: str) -> list[_Node]:
        return [child for child in self.children if child.element.tag in tags]


def plain_urdf(file: ModelFile) -> UrdfText:
    """The links, joints and materials of a file whose attributes have been checked."""
    made, root = UrdfText(), _tree(file)
    root.children = [child for child in root.children if child.element.known]
    _drop_xacro(root, "", made)
    for link in root.named("link"):
        _solids(link, made)
    made.text = "".join(_written(root)).encode()
    return made


def _tree(file: ModelFile) -> _Node:
    open_now: list[_Node] = []
    for element in file.elements:
        node = _Node(element)
        del open_now[element.depth :]
        if open_now:
            open_now[-1].children.append(node)
        open_now.append(node)
    return open_now[0]


def _drop_xacro(node: _Node, link: str, made: UrdfText) -> None:
    """Removes left-over xacro elements."""
    if node.element.tag == "link":
        link = node.element.attributes.get("name", "")
    for child in node.children:
        if child.element.tag.startswith(XACRO):
            text = f"has <{child.element.tag[:60]}>, left out: run xacro on the file for it"
            made.left_out.append((link, text, child.element.line))
        else:
            _drop_xacro(child, link, made)
    node.children = [c for c in node.children if not c.element.tag.startswith(XACRO)]


def _solids(link: _Node, made: UrdfText) -> None:
    """Removes visuals and collisions without a solid, and notes capsules."""
    name, counts = link.element.attributes["name"], {"visual": 0, "collision": 0}
    for solid in link.named("visual", "collision"):
        kind = solid.element.tag
        geometry = next(iter(solid.named("geometry")), None)
        found = [] if geometry is None else geometry.named(*SOLIDS)
        if geometry is None or not found:
            link.children.remove(solid)
            made.left_out.append((name, f"has an empty {kind}, left out", solid.element.line))
            continue
        geometry.children = found
        if found[0].element.tag == "capsule":
            made.capsules.add((name, kind, counts[kind]))
        counts[kind] += 1


def _written(node: _Node) -> list[str]:
    tag = node.element.tag
    plain = "cylinder" if tag == "capsule" else tag
    given = "".join(f" {key}={quoteattr(x)}" for key, x in node.element.attributes.items())
    inside = [text for child in node.children for text in _written(child)]
    return [f"<{plain}{given}>", *inside, f"</{plain}>"]
