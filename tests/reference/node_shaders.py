# SPDX-License-Identifier: Apache-2.0
"""MaterialX's own GLSL for one node, run on OpenGL for many rows of inputs: `nodes.py` asks for it.

The pixel shader that MaterialX's generator writes becomes a compute shader: uniforms and what the vertex shader hands
over are read from a buffer, and what the node gives is written to another. Nothing of its functions is changed but for
`precise` at every variable, so that the driver neither merges nor moves operations. A texture is the formula
(u, v, u v, u - v), which has no filter; differences between pixels are 0, so that steps are sharp.
"""

import os
import re
from dataclasses import dataclass

import MaterialX as mx
import moderngl
import numpy as np
from MaterialX import PyMaterialXGenGlsl as glsl
from MaterialX import PyMaterialXGenShader as gen

from node_inputs import WIDTHS

TYPES = {"float": 1, "int": 1, "bool": 1, "vec2": 2, "vec3": 3, "vec4": 4, "mat3": 9, "mat4": 16}
NUMBER = r"(?:float|vec[234]|mat[34])"
PRELUDE = """
#define sampler2D int
vec4 oocpt_texel(vec2 p) { return vec4(p.x, p.y, p.x * p.y, p.x - p.y); }
#define texture(s, p) oocpt_texel(p)
#define textureLod(s, p, l) oocpt_texel(p)
#define textureSize(s, l) ivec2(1)
#define mx_environment_radiance(n, v, x, a, d, f) vec3(0.0)
#define mx_environment_irradiance(n) vec3(0.0)
#define dFdx(x) (0.0 * (x))
#define dFdy(x) (0.0 * (x))
layout(std430, binding = 0) readonly buffer Rows { float oocpt_rows[]; };
layout(std430, binding = 1) writeonly buffer Results { float oocpt_results[]; };
layout(local_size_x = 64) in;
"""


@dataclass(frozen=True)
class Shader:
    """A compute shader; what it reads of a row besides inputs (geometry: name and width)."""

    text: str
    geometry: list[tuple[str, int]]


class Oracle:
    """MaterialX's libraries and generator, and a device."""

    def __init__(self) -> None:
        self.document = mx.createDocument()
        self.search = mx.getDefaultDataSearchPath()
        mx.loadLibraries(mx.getDefaultDataLibraryFolders(), self.search, self.document)
        self.generator = glsl.GlslShaderGenerator.create()
        self.context = gen.GenContext(self.generator)
        self.context.registerSourceCodeSearchPath(self.search)
        self.context.getOptions().shaderInterfaceType = gen.ShaderInterfaceType.SHADER_INTERFACE_COMPLETE
        os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"
        self.device = moderngl.create_context(standalone=True, backend="egl", require=430)
        if "llvmpipe" not in self.device.info["GL_RENDERER"]:
            raise SystemExit(f"{self.device.info['GL_RENDERER']} is not Mesa's software device")

    def versions(self) -> str:
        """What made the values."""
        return f"MaterialX {mx.__version__}, {self.device.info['GL_RENDERER']}, {self.device.info['GL_VERSION']}"

    def source(self, nodedef: mx.NodeDef, texts: dict[str, str], output: mx.Output) -> str:
        """The pixel shader of a node with these texts."""
        node = self.document.addNodeInstance(nodedef, "n")
        root = self.document.addOutput("o", output.getType())
        try:
            for port in nodedef.getActiveInputs():
                value = node.addInput(port.getName(), port.getType())
                kind = port.getType()
                if port.getDefaultGeomPropString():
                    # A value alone gives way to the geometry; so it comes from a node, whose sum with 0 is itself.
                    helper = self.document.addNode("add", f"c_{port.getName()}", kind)
                    helper.addInput("in1", kind).setValueString(", ".join(["0"] * WIDTHS[kind]))
                    value.setNodeName(helper.getName())
                elif kind in WIDTHS:
                    value.setValueString(port.getValueString() or ", ".join(["0"] * WIDTHS[kind]))
                else:
                    value.setValueString(texts.get(port.getName(), port.getValueString()))
            root.setNodeName("n")
            if len(nodedef.getActiveOutputs()) > 1:
                root.setOutputString(output.getName())
            return self.generator.generate("t", root, self.context).getSourceCode("pixel")
        finally:
            self.document.removeOutput("o")
            for known in [*self.document.getNodes()]:
                self.document.removeNode(known.getName())

    def shader(self, nodedef: mx.NodeDef, texts: dict[str, str], output: mx.Output) -> Shader:
        """The compute shader: inputs by the order of the definition, then geometry."""
        text = self.source(nodedef, texts, output)
        text = text.replace("#version 400", "")
        text = re.sub(r"^out vec4 o;$", "", text, flags=re.MULTILINE)
        geometry: list[tuple[str, int]] = []
        block = re.search(r"in VertexData\s*\{(.*?)\} vd;", text, flags=re.DOTALL)
        if block:
            members = re.findall(r"(\w+) (\w+);", block[1])
            body = block[1].replace("flat ", "")
            geometry = [(name, TYPES[kind]) for kind, name in members]
            text = text.replace(block[0], f"struct VertexData {{{body}}}; VertexData vd;")
        reads = []
        at = 0
        for port in nodedef.getActiveInputs():
            width = WIDTHS.get(port.getType())
            if width is None:
                continue
            name = re.escape(port.getName())
            found = re.search(rf"^uniform (\w+) (n_{name}|c_{name}_in1)\b.*?;$", text, flags=re.MULTILINE)
            if found:
                reads.append(read(found[1], found[2], at))
            at += width
        for name, width in geometry:
            kind = next(kind for kind, known in members if known == name)
            reads.append(read(kind, f"vd.{name}", at))
            at += width
        # Other uniforms keep their values; matrices of spaces change nothing.
        text = re.sub(r"^uniform mat4 (\w+).*?;$", r"mat4 \1 = mat4(1.0);", text, flags=re.MULTILINE)
        text = re.sub(r"^uniform sampler2D (\w+);$", r"int \1 = 0;", text, flags=re.MULTILINE)
        text = re.sub(r"^uniform (.*?;)$", r"\1", text, flags=re.MULTILINE)
        text = precise(text)
        width = WIDTHS[output.getType()]
        store = "".join(f"    oocpt_results[oocpt_at * {width} + {k}] = {v};\n" for k, v in enumerate(values(output)))
        text = re.sub(r"^    o = .*?;$", store, text, flags=re.MULTILINE)
        loads = f"    int oocpt_at = int(gl_GlobalInvocationID.x), oocpt_from = oocpt_at * {at};\n" + "".join(reads)
        text = re.sub(r"^void main\(\)\n\{", lambda found: found[0] + "\n" + loads, text, flags=re.MULTILINE)
        return Shader("#version 430\n" + PRELUDE + text, geometry)

    def run(self, shader: Shader, rows: np.ndarray, width: int) -> np.ndarray:
        """What it gives for rows of inputs and geometry."""
        count = len(rows)
        padded = np.zeros((-(-count // 64) * 64, rows.shape[1]), np.float32)
        padded[:count] = rows
        program = self.device.compute_shader(shader.text)
        inputs = self.device.buffer(padded.tobytes() or b"\0" * 16)
        results = self.device.buffer(reserve=len(padded) * width * 4)
        try:
            inputs.bind_to_storage_buffer(0)
            results.bind_to_storage_buffer(1)
            program.run(len(padded) // 64)
            return np.frombuffer(results.read(), np.float32).reshape(-1, width)[:count].copy()
        finally:
            for one in (inputs, results, program):
                one.release()


def read(kind: str, name: str, at: int) -> str:
    """Statement that reads a variable of a row."""
    parts = ", ".join(f"oocpt_rows[oocpt_from + {at + k}]" for k in range(TYPES[kind]))
    return f"    {name} = {parts} != 0.0;\n" if kind == "bool" else f"    {name} = {kind}({parts});\n"


def values(output: mx.Output) -> list[str]:
    """The components of what a node gives, as floats."""
    kind, name = output.getType(), f"n_{output.getName()}"
    width = WIDTHS[kind]
    if width == 1:
        return [f"float({name})"]
    if kind.startswith("matrix"):
        side = 3 if width == 9 else 4
        return [f"{name}[{k // side}][{k % side}]" for k in range(width)]
    return [f"{name}[{k}]" for k in range(width)]


def precise(text: str) -> str:
    """`precise` at every variable of every function, and at what functions return."""
    lines = []
    returned = ""
    is_struct = False
    for line in text.split("\n"):
        if is_struct or line.startswith("struct"):
            is_struct = "}" not in line
            lines.append(line)
            continue
        if head := re.match(rf"^({NUMBER}|\w+) \w+\((.*)\)\s*(\{{.*)?$", line):
            returned = head[1]
            if not line.startswith("void main"):
                parts = re.sub(rf"(?<=[(,])\s*((?:in|out|inout) )?({NUMBER} \w+)", r" precise \1\2", line)
                line = parts
        line = re.sub(rf"^(\s+)(?:const )?({NUMBER} \w+\b(?!\())", r"\1precise \2", line)
        if re.fullmatch(NUMBER, returned):
            give = rf"{{ precise {returned} oocpt_r = \1; return oocpt_r; }}"
            line = re.sub(r"\breturn (.*?);", give, line)
        lines.append(line)
    return "\n".join(lines)
