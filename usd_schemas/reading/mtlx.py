"""MaterialX documents as USD layers: usd-core has no reader of `.mtlx`, so documents of a stage are translated here.

Prims get the paths that other programs give them: `/MaterialX/Materials/NAME`, with the surface inside it, and
`/MaterialX/NodeGraphs/NAME`. Documents that a document includes are not read.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf

from groundwork.errors import InputError
from groundwork.foreign_file import read_regular

SUFFIX = ".mtlx"
_TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "integer": Sdf.ValueTypeNames.Int,
    "boolean": Sdf.ValueTypeNames.Bool,
    "string": Sdf.ValueTypeNames.String,
    "filename": Sdf.ValueTypeNames.Asset,
    "color3": Sdf.ValueTypeNames.Color3f,
    "color4": Sdf.ValueTypeNames.Color4f,
    "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3,
    "vector4": Sdf.ValueTypeNames.Float4,
}
_WIDTHS = {"color3": 3, "color4": 4, "vector2": 2, "vector3": 3, "vector4": 4}
_INCLUDE = re.compile(rb"<(?:\w+:)?include\b")
_BY_INPUT = ("convert", "extract", "separate2", "separate3", "separate4")  # their definition names the type
_DEEPEST = 100  # largest number of nodes in a row
_LARGEST = 50_000_000  # bytes


@dataclass(frozen=True)
class Document:
    """A MaterialX document.

    Attributes:
        path: Its file.
        content: The document as MaterialX parsed it.
        includes: Whether it includes other documents, which are not read.
    """

    path: Path
    content: Any
    includes: bool


def read_document(path: Path) -> Document:
    """Read a document, without those that it includes.

    Args:
        path: `.mtlx` file.

    Raises:
        InputError: Not such a document, or too large.
    """
    import MaterialX

    data = read_regular(path)
    if len(data) > _LARGEST:
        raise InputError("the document is too large", where=path, value=len(data), allowed=f"up to {_LARGEST} bytes")
    options = MaterialX.XmlReadOptions()
    options.readXIncludeFunction = None
    content = MaterialX.createDocument()
    try:
        MaterialX.readFromXmlString(content, data.decode(), MaterialX.FileSearchPath(), options)
    except (MaterialX.ExceptionParseError, MaterialX.Exception, UnicodeDecodeError) as error:
        raise InputError(f"not readable as MaterialX: {error}", where=path, hint="Check the file") from None
    return Document(path, content, _INCLUDE.search(data) is not None)


def named_files(document: Document) -> list[str]:
    """List every file that a document refers to, relative to the document's folder.

    Args:
        document: The document.
    """
    found = set()
    for element in document.content.traverseTree():
        if element.isA(_input_type()) and element.getType() == "filename" and element.getValueString():
            found.add(_file_of(document, element))
    return sorted(found)


def translate(document: Document) -> Sdf.Layer:
    """Turn a document into an anonymous layer.

    Args:
        document: The document.

    Raises:
        InputError: A name in it is not valid in USD.
    """
    layer = Sdf.Layer.CreateAnonymous(document.path.name + ".usda")
    try:
        _write(layer, document)
    except Tf.ErrorException as error:
        said = str(error).rpartition(" : ")[2].strip(" '\n")
        raise InputError(f"cannot be written as USD: {said}", where=document.path, hint="Export it again") from None
    return layer


def _write(layer: Sdf.Layer, document: Document) -> None:
    layer.defaultPrim = "MaterialX"
    root = _define(layer, "/MaterialX", "Scope")
    graphs = document.content.getNodeGraphs()
    if graphs:
        _define(layer, f"{root}/NodeGraphs", "Scope")
    for graph in graphs:
        _write_graph(layer, document, f"{root}/NodeGraphs/{_name(graph)}", graph)
    _define(layer, f"{root}/Materials", "Scope")
    for material in document.content.getMaterialNodes():
        _write_material(layer, document, f"{root}/Materials/{_name(material)}", material)


def _input_type() -> type:
    import MaterialX

    return MaterialX.Input


def _name(element: Any) -> str:
    return Tf.MakeValidIdentifier(str(element.getName()))


def _define(layer: Sdf.Layer, path: str, kind: str) -> str:
    spec = Sdf.CreatePrimInLayer(layer, path)
    spec.specifier, spec.typeName = Sdf.SpecifierDef, kind
    return path


def _file_of(document: Document, element: Any) -> str:
    """Path of a file relative to the document's folder; prefixes are added unless the file exists only without them."""
    whole, bare = str(element.getResolvedValueString()), str(element.getValueString())
    folder = document.path.parent
    try:
        return bare if not (folder / whole).is_file() and (folder / bare).is_file() else whole
    except (OSError, ValueError):
        return whole


def _write_material(layer: Sdf.Layer, document: Document, path: str, material: Any) -> None:
    """Write a material: its surface is inside it, and the surface's inputs are those of the material."""
    _define(layer, path, "Material")
    told = material.getInput("surfaceshader")
    shader = told.getConnectedNode() if told is not None else None
    if shader is None:
        return
    identifier = _identifier(shader)
    inside = _define(layer, f"{path}/{identifier}", "Shader")
    _token(layer, inside, "info:id", identifier)
    Sdf.AttributeSpec(layer.GetPrimAtPath(inside), "outputs:out", Sdf.ValueTypeNames.Token)
    surface = Sdf.AttributeSpec(layer.GetPrimAtPath(path), "outputs:mtlx:surface", Sdf.ValueTypeNames.Token)
    surface.connectionPathList.explicitItems = [Sdf.Path(f"{inside}.outputs:out")]
    for one in shader.getInputs():
        source = _source(layer, document, path, one, 0)
        if source is not None:
            _connect(layer, inside, one, source)
        elif one.getType() in _TYPES:
            held = _value(layer, document, path, one)
            _connect(layer, inside, one, held)


def _write_graph(layer: Sdf.Layer, document: Document, path: str, graph: Any) -> None:
    """Write a node graph with its nodes, and an output for each of its outputs."""
    if layer.GetPrimAtPath(path):
        return
    _define(layer, path, "NodeGraph")
    for own in graph.getInputs():
        if own.getType() in _TYPES:
            _value(layer, document, path, own)
    for output in graph.getOutputs():
        node = output.getConnectedNode()
        kind = _TYPES.get(str(output.getType()))
        if node is None or kind is None:
            continue
        inside = _write_node(layer, document, path, node, 1)
        spec = Sdf.AttributeSpec(layer.GetPrimAtPath(path), f"outputs:{output.getName()}", kind)
        spec.connectionPathList.explicitItems = [Sdf.Path(f"{inside}.outputs:{_output_name(output)}")]


def _write_node(layer: Sdf.Layer, document: Document, home: str, node: Any, depth: int) -> str:
    """Write a node beside the nodes connected to its inputs; returns its path."""
    path = f"{home}/{_name(node)}"
    if layer.GetPrimAtPath(path) or depth > _DEEPEST:
        return path
    _define(layer, path, "Shader")
    _token(layer, path, "info:id", _identifier(node))
    kind = _TYPES.get(str(node.getType()), Sdf.ValueTypeNames.Token)
    Sdf.AttributeSpec(layer.GetPrimAtPath(path), "outputs:out", kind)
    for one in node.getInputs():
        source = _source(layer, document, home, one, depth)
        if source is not None:
            _connect(layer, path, one, source)
        elif one.getInterfaceName() and layer.GetAttributeAtPath(f"{home}.inputs:{one.getInterfaceName()}"):
            _connect(layer, path, one, f"{home}.inputs:{one.getInterfaceName()}")
        elif one.getType() in _TYPES:
            _value(layer, document, path, one)
    return path


def _source(layer: Sdf.Layer, document: Document, home: str, one: Any, depth: int) -> str | None:
    """Write the node that is connected to an input beside it; None if the input has a value of its own."""
    graph = one.getNodeGraphString()
    if graph:
        found = document.content.getNodeGraph(graph)
        output = one.getConnectedOutput()
        if found is None or output is None:
            return None
        inside = f"{home}/{_name(found)}"
        _write_graph(layer, document, inside, found)
        return f"{inside}.outputs:{output.getName()}"
    node = one.getConnectedNode()
    if node is None:
        return None
    return f"{_write_node(layer, document, home, node, depth + 1)}.outputs:{_output_name(one)}"


def _output_name(port: Any) -> str:
    return str(port.getOutputString() or "out")


def _identifier(node: Any) -> str:
    """Name of a node's definition; standard ones are written as in their library."""
    told = str(node.getNodeDefString())
    if told:
        return told
    category, kind = str(node.getCategory()), str(node.getType())
    if category in _BY_INPUT:
        one = node.getInput("in")
        kind = (
            f"{one.getType()}_{kind}" if category == "convert" and one is not None else one.getType() if one else kind
        )
    return "ND_normalmap" if category == "normalmap" else f"ND_{category}_{kind}"


def _token(layer: Sdf.Layer, path: str, name: str, value: str) -> None:
    spec = Sdf.AttributeSpec(layer.GetPrimAtPath(path), name, Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform)
    spec.default = value


def _spec(layer: Sdf.Layer, path: str, one: Any) -> Sdf.AttributeSpec:
    name = f"inputs:{one.getName()}"
    kind = _TYPES.get(str(one.getType()), Sdf.ValueTypeNames.Token)
    found = layer.GetAttributeAtPath(f"{path}.{name}")
    return found or Sdf.AttributeSpec(layer.GetPrimAtPath(path), name, kind)


def _connect(layer: Sdf.Layer, path: str, one: Any, source: str) -> None:
    _spec(layer, path, one).connectionPathList.explicitItems = [Sdf.Path(source)]


def _value(layer: Sdf.Layer, document: Document, path: str, one: Any) -> str:
    """Write an input's value; returns the path of the attribute."""
    spec, kind, value = _spec(layer, path, one), str(one.getType()), one.getValue()
    if kind == "filename":
        space = str(one.getActiveColorSpace())
        spec.default = Sdf.AssetPath(str(document.path.parent / _file_of(document, one)))
        if space:
            spec.colorSpace = space
    elif value is not None:
        spec.default = tuple(value[place] for place in range(_WIDTHS[kind])) if kind in _WIDTHS else value
    return f"{path}.{spec.name}"


class Adopted:
    """The documents that a stage refers to, as layers; these exist as long as this object.

    Attributes:
        files: Document of each anonymous layer, by its identifier.
        notes: One line for each thing that was not read.
    """

    def __init__(self, root: Path) -> None:
        """Translate every document that a stage refers to, and let its layers refer to the translations.

        The files do not change: layers are changed in memory.

        Args:
            root: Root layer of the stage.
        """
        self.files: dict[str, Path] = {}
        self.notes: list[str] = []
        self._known: dict[Path, Sdf.Layer | None] = {}
        self._kept = list(self._walk(root.resolve()))

    def _walk(self, root: Path) -> Iterator[Sdf.Layer]:
        pending, seen = [root], set()
        while pending:
            file = pending.pop()
            if file in seen:
                continue
            seen.add(file)
            layer = Sdf.Layer.FindOrOpen(str(file)) if file.suffix != ".usdz" else None
            if layer is None:
                continue
            yield layer
            for name in sorted(layer.GetCompositionAssetDependencies()):
                target = (file.parent / name).resolve()
                if not target.is_file():
                    continue
                if target.suffix.lower() == SUFFIX:
                    self._adopt(layer, name, target)
                elif Sdf.FileFormat.FindByExtension(target.suffix.lstrip(".")):
                    pending.append(target)

    def _adopt(self, layer: Sdf.Layer, name: str, target: Path) -> None:
        if target not in self._known:
            self._known[target] = self._translated(target)
        made = self._known[target]
        if made is not None:
            layer.UpdateCompositionAssetDependency(name, made.identifier)

    def _translated(self, target: Path) -> Sdf.Layer | None:
        try:
            document = read_document(target)
        except InputError as error:
            self.notes.append(f"{error}: left out")
            return None
        if document.includes:
            self.notes.append(f"{target}: the files that it includes are not read")
        layer = translate(document)
        self.files[layer.identifier] = target
        return layer
