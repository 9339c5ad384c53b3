# SPDX-License-Identifier: Apache-2.0
"""What every pattern node of MaterialX gives at random inputs, by MaterialX's own GLSL on a software device.

    nodes.py TABLE [--rows 1000] [--seed 1] [--only PART]

For each definition of the data libraries whose outputs are numbers: its shader (`node_shaders.py`) at seeded random
inputs (`node_inputs.py`). Sines, powers and the like of one operation are numpy's in f64, rounded: a software device
has approximations of them. `rust/materialx/tests/data/nodes.csv` is a table of few rows; the crate's example `nodes`
reads tables of any size, evaluates the same nodes and prints errors.

A table has blocks: `= DEFINITION CATEGORY OUTPUT:TYPE | NAME:TYPE ... | @GEOMETRY:WIDTH ...`, then a row a line: values
of inputs, a semicolon, what is expected. An input with `!` is uniform, `<Nworld` is what it is where nothing is said.
A row with `*` has all defaults. `- DEFINITION why` is one that has no values.
"""

import argparse
import itertools
import sys
import time
from pathlib import Path

import MaterialX as mx
import moderngl
import numpy as np

from node_inputs import WIDTHS, places, table
from node_shaders import Oracle

# Texts that have an effect on the node, or that it cannot do without.
TEXTS = {"space": ["object", "world", "model"], "geomprop": ["some"], "varname": ["some"]}
EXACT = {
    "constant": np.asarray,  # the generator leaves it out
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "sqrt": np.sqrt,
    "ln": np.log,
    "exp": np.exp,
    "atan2": np.arctan2,
    "power": np.power,
    "safepower": lambda a, b: np.sign(a) * np.power(np.abs(a), b),
}
NOT_COMPARED = {
    "UsdPrimvarReader": "the generator cannot bind the primvar that it names",
    "blur": "a filter over pixels of the screen",
    "heighttonormal": "a filter over pixels of the screen",
    "bump": "a filter over pixels of the screen",
    "determinant": "a matrix",
    "time": "no number of the surface",
    "frame": "no number of the surface",
}


def draws(nodedef: mx.NodeDef) -> list[dict[str, str]]:
    """Combinations of the texts of a definition."""
    names = [port.getName() for port in nodedef.getActiveInputs() if port.getType() == "string"]
    names = [name for name in names if name in TEXTS]
    return [dict(zip(names, one, strict=True)) for one in itertools.product(*(TEXTS[name] for name in names))]


def described(port: mx.Input) -> str:
    """An input in the head of a block."""
    default = port.getDefaultGeomPropString()
    return f"{port.getName()}:{port.getType()}" + "!" * port.getIsUniform() + ("<" + default) * bool(default)


def default(port: mx.Input, otherwise: np.ndarray) -> np.ndarray:
    """What an input is where nothing is said; of the geometry any number."""
    text = port.getValueString()
    if port.getDefaultGeomPropString() or not text:
        return otherwise if port.getDefaultGeomPropString() else np.zeros_like(otherwise)
    return np.array([{"true": 1.0, "false": 0.0}.get(part.strip(), part) for part in text.split(",")], float)


def exactly(category: str, inputs: list[np.ndarray]) -> np.ndarray:
    """A function of one operation, in f64 of what f32 has."""
    wide = [values.astype(np.float32).astype(np.float64) for values in inputs]
    with np.errstate(all="ignore"):
        return np.asarray(EXACT[category](*wide)).astype(np.float32)


def block(oracle: Oracle, nodedef: mx.NodeDef, output: mx.Output, rows: int, seed: int) -> list[str]:
    """Lines of one output of one definition."""
    category = nodedef.getNodeString()
    ports = [(port.getName(), port.getType()) for port in nodedef.getActiveInputs() if port.getType() in WIDTHS]
    width = WIDTHS[output.getType()]
    lines: list[str] = []
    combinations = draws(nodedef)
    for at, texts in enumerate(combinations):
        count = rows // len(combinations) + (at < rows % len(combinations))
        rng = np.random.default_rng([seed, at, *nodedef.getName().encode()])
        inputs = table(category, ports, rng, count)
        if at == 0:
            for values, (name, _) in zip(inputs, ports, strict=True):
                values[0] = default(nodedef.getActiveInput(name), values[0])
        shader = None if category in EXACT else oracle.shader(nodedef, texts, output)
        geometry = shader.geometry if shader else []
        seen = [np.round(places(rng, (count, wide)), 3) + 0.0 for _, wide in geometry]
        if output.getType() == "integer":
            seen = [np.floor(values) for values in seen]
        parts = [*inputs, *seen]
        given = np.hstack(parts) if parts else np.zeros((count, 0))
        expected = oracle.run(shader, given, width) if shader else exactly(category, inputs)
        about = [described(port) for port in nodedef.getActiveInputs() if port.getType() in WIDTHS]
        said = [f"{name}={text}" for name, text in texts.items()]
        reads = [f"@{name}:{wide}" for name, wide in geometry]
        result = f"{output.getName()}:{output.getType()}"
        lines.append(" ".join(["=", nodedef.getName(), category, result, "|", *about, *said, "|", *reads]))
        lines.extend(
            "*" * (at + k == 0) + ",".join(f"{x:.9g}" for x in row) + ";" + ",".join(f"{x:.9g}" for x in answer)
            for k, (row, answer) in enumerate(zip(given.tolist(), expected.tolist(), strict=True))
        )
    return lines


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("--rows", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    started = time.monotonic()
    oracle = Oracle()
    lines = [
        f"# What MaterialX's own GLSL gives, by tests/reference/nodes.py --rows {options.rows} --seed {options.seed}:",
        f"# {oracle.versions()}; numpy {np.__version__}.",
    ]
    done = 0
    for nodedef in sorted(oracle.document.getNodeDefs(), key=lambda known: known.getName()):
        outputs = nodedef.getActiveOutputs()
        if options.only not in nodedef.getName() or any(port.getType() not in WIDTHS for port in outputs):
            continue
        why = NOT_COMPARED.get(nodedef.getNodeString())
        if any(port.getType().startswith("matrix") for port in outputs):
            why = "a matrix"
        elif nodedef.getName() == "ND_geompropvalue_boolean":
            why = "the shader reads no boolean of the geometry"
        if why is None:
            try:
                found = [block(oracle, nodedef, output, options.rows, options.seed) for output in outputs]
                lines.extend(itertools.chain.from_iterable(found))
                done += 1
                continue
            except (moderngl.Error, mx.Exception, LookupError) as error:
                why = " ".join(str(error).split())[:300]
        lines.append(f"- {nodedef.getName()} {why}")
    options.table.write_text("\n".join(lines) + "\n")
    print(f"{done} definitions in {time.monotonic() - started:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
