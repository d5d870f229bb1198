"""Reduction of URDF to links, joints and materials in a form that yourdfpy can read.

URDF is the format of robots in ROS, and xacro a macro language for it. A solid is a shape of a body
or an obstacle.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

from fantoccini.output.exchange.model_file import XACRO, Element, ModelFile

SOLIDS = frozenset({"box", "capsule", "cylinder", "mesh", "sphere"})
"""Tags of solids."""


@dataclass
class UrdfText:
    """Text with the links, joints and materials of a file.

    Attributes:
        text: XML, with capsules written as cylinders, because yourdfpy cannot read capsules.
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

    def children_with(self, *tags: str) -> list[_Node]:
        return [child for child in self.children if child.element.tag in tags]


def reduce_urdf(file: ModelFile) -> UrdfText:
    """Links, joints and materials of a file whose attributes have been checked."""
    result, root = UrdfText(), _tree(file)
    root.children = [child for child in root.children if child.element.in_model]
    _drop_xacro(root, "", result)
    for link in root.children_with("link"):
        _drop_empty_solids(link, result)
    result.text = "".join(_xml_texts(root)).encode()
    return result


def _tree(file: ModelFile) -> _Node:
    open_nodes: list[_Node] = []
    for element in file.elements:
        node = _Node(element)
        del open_nodes[element.depth :]
        if open_nodes:
            open_nodes[-1].children.append(node)
        open_nodes.append(node)
    return open_nodes[0]


def _drop_xacro(node: _Node, link: str, result: UrdfText) -> None:
    """Removes unexpanded xacro elements."""
    if node.element.tag == "link":
        link = node.element.attributes.get("name", "")
    for child in node.children:
        if child.element.tag.startswith(XACRO):
            text = f"has <{child.element.tag[:60]}>, left out: run xacro on the file for it"
            result.left_out.append((link, text, child.element.line))
        else:
            _drop_xacro(child, link, result)
    node.children = [c for c in node.children if not c.element.tag.startswith(XACRO)]


def _drop_empty_solids(link: _Node, result: UrdfText) -> None:
    """Removes visuals and collisions without a solid, and records capsules."""
    name, counts = link.element.attributes["name"], {"visual": 0, "collision": 0}
    for solid in link.children_with("visual", "collision"):
        kind = solid.element.tag
        geometry = next(iter(solid.children_with("geometry")), None)
        shapes = [] if geometry is None else geometry.children_with(*SOLIDS)
        if geometry is None or not shapes:
            link.children.remove(solid)
            result.left_out.append((name, f"has an empty {kind}, left out", solid.element.line))
            continue
        geometry.children = shapes
        if shapes[0].element.tag == "capsule":
            result.capsules.add((name, kind, counts[kind]))
        counts[kind] += 1


def _xml_texts(node: _Node) -> list[str]:
    tag = node.element.tag
    written_tag = "cylinder" if tag == "capsule" else tag
    attributes = "".join(f" {key}={quoteattr(x)}" for key, x in node.element.attributes.items())
    contents = [text for child in node.children for text in _xml_texts(child)]
    return [f"<{written_tag}{attributes}>", *contents, f"</{written_tag}>"]
