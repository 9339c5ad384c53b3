# SPDX-License-Identifier: Apache-2.0
"""Reads every AOV of a UsdImagingGL.Engine, and decodes picks, which the Python binding does not offer.

Used by the Python package and by tests/hydra. Runs inside a wheel host only (OpenUSD 25.08 or 26.03, Itanium ABI):
calls the C++ functions of the loaded libusd_ms through ctypes. Symbols are looked up by their mangled names, virtual
functions by their slot in `HdRenderBuffer`; both are checked on import against a concrete class of the runtime by
tests/abi. All functions must be called on the thread that owns the engine.
"""

from __future__ import annotations

import ctypes
import os
from ctypes import POINTER, byref, c_char_p, c_int, c_size_t, c_uint8, c_uint64, c_void_p

import numpy as np
from pxr import Usd

_NAMESPACE = "pxrBlender_v{1:02}_{2:02}__pxrReserved__".format(*Usd.GetVersion())
_N = f"{len(_NAMESPACE)}{_NAMESPACE}"

# HdFormat: number -> (numpy type, components).
FORMATS = {
    12: ("f4", 1), 13: ("f4", 2), 14: ("f4", 3), 15: ("f4", 4), 24: ("i4", 1), 8: ("f2", 1), 11: ("f2", 4),
    3: ("u1", 4),
}
FORMAT_NAMES = {12: "Float32", 14: "Float32Vec3", 15: "Float32Vec4", 24: "Int32"}
# Slots of HdRenderBuffer's virtual table.
_WIDTH, _HEIGHT, _FORMAT, _MAP, _UNMAP, _RESOLVE, _IS_CONVERGED = 6, 7, 9, 11, 12, 14, 15


class _Vector(ctypes.Structure):
    """std::vector of libstdc++."""

    _fields_ = [("begin", c_void_p), ("end", c_void_p), ("capacity", c_void_p)]


def _library() -> ctypes.PyDLL:
    with open("/proc/self/maps", encoding="utf-8") as maps:
        paths = {line.split()[-1] for line in maps if line.rstrip().endswith("libusd_ms.so")}
    if len(paths) != 1:
        raise RuntimeError(f"expected one loaded libusd_ms.so, found {sorted(paths)}")
    return ctypes.PyDLL(paths.pop(), mode=os.RTLD_NOLOAD | os.RTLD_NOW)


_lib = _library()


def _function(mangled: str, result, *arguments):
    function = getattr(_lib, mangled)
    function.restype, function.argtypes = result, list(arguments)
    return function


_query = _function(f"_ZN{_N}9pxr_boost6python9converter8registry5queryENS1_9type_infoE", c_void_p, c_char_p)
_lvalue = _function(
    f"_ZN{_N}9pxr_boost6python9converter22get_lvalue_from_pythonEP7_objectRKNS2_12registrationE", c_void_p,
    ctypes.py_object, c_void_p,
)
_token = _function(f"_ZN{_N}7TfTokenC1EPKc", None, c_void_p, c_char_p)
_set_aovs = _function(
    f"_ZN{_N}18UsdImagingGLEngine15SetRendererAovsERKSt6vectorINS_7TfTokenESaIS2_EE", c_uint8, c_void_p,
    POINTER(_Vector),
)
_get_buffer = _function(
    f"_ZNK{_N}18UsdImagingGLEngine18GetAovRenderBufferERKNS_7TfTokenE", c_void_p, c_void_p, POINTER(c_uint64)
)
_decode = _function(
    f"_ZN{_N}18UsdImagingGLEngine18DecodeIntersectionEiiPNS_7SdfPathES2_PiPSt6vectorISt4pairIS1_iESaIS6_EE",
    c_uint8, c_void_p, c_int, c_int, c_void_p, c_void_p, POINTER(c_int), POINTER(_Vector),
)  # fmt: skip
_path_text = _function(f"_ZNK{_N}7SdfPath7GetTextEv", c_char_p, c_void_p)


def _tokens(names: list[str]) -> ctypes.Array:
    array = (c_uint64 * len(names))()
    for index, name in enumerate(names):
        _token(ctypes.addressof(array) + 8 * index, name.encode())
    return array


def _engine(engine) -> int:
    registration = _query(f"N{_N}18UsdImagingGLEngineE".encode())
    pointer = registration and _lvalue(engine, registration)
    if not pointer:
        raise RuntimeError("not a UsdImagingGL.Engine")
    return pointer


def set_aovs(engine, names: list[str]) -> bool:
    """Binds these AOVs; False if the delegate or the engine refuses one."""
    array = _tokens(names)
    start = ctypes.addressof(array)
    vector = _Vector(start, start + 8 * len(names), start + 8 * len(names))
    return bool(_set_aovs(_engine(engine), byref(vector)))


def _virtual(buffer: int, slot: int, result):
    table = ctypes.cast(buffer, POINTER(c_void_p))[0]
    address = ctypes.cast(table, POINTER(c_void_p))[slot]
    return ctypes.CFUNCTYPE(result, c_void_p)(address)(buffer)


def buffer_state(engine, name: str) -> dict | None:
    """Width, height, format name and convergence of a bound AOV's buffer; None if there is none."""
    token = _tokens([name])
    buffer = _get_buffer(_engine(engine), ctypes.cast(token, POINTER(c_uint64)))
    if not buffer:
        return None
    number = _virtual(buffer, _FORMAT, c_int)
    return {
        "width": _virtual(buffer, _WIDTH, ctypes.c_uint),
        "height": _virtual(buffer, _HEIGHT, ctypes.c_uint),
        "format": FORMAT_NAMES.get(number, str(number)),
        "converged": bool(_virtual(buffer, _IS_CONVERGED, ctypes.c_bool)),
    }


def read(engine, name: str, resolves: bool = True) -> np.ndarray | None:
    """A copy of a bound AOV, (height, width[, components]), row 0 at the bottom; None if there is no buffer or no
    data. Blender never resolves."""
    token = _tokens([name])
    buffer = _get_buffer(_engine(engine), ctypes.cast(token, POINTER(c_uint64)))
    if not buffer:
        return None
    if resolves:
        _virtual(buffer, _RESOLVE, None)
    width, height = _virtual(buffer, _WIDTH, ctypes.c_uint), _virtual(buffer, _HEIGHT, ctypes.c_uint)
    kind, components = FORMATS[_virtual(buffer, _FORMAT, c_int)]
    data = _virtual(buffer, _MAP, c_void_p)
    if not data:
        return None
    size = width * height * components * np.dtype(kind).itemsize
    try:
        pixels = np.frombuffer(ctypes.string_at(data, size), dtype=kind)
    finally:
        _virtual(buffer, _UNMAP, None)
    shape = (height, width) if components == 1 else (height, width, components)
    return pixels.reshape(shape)


def decode(engine, prim_id: int, instance_id: int) -> dict | None:
    """What Hydra makes of the ids of a pixel: paths of prim and instancer, instance index, and all levels outer to
    inner."""
    prim, instancer = (c_uint64 * 1)(), (c_uint64 * 1)()
    index, context = c_int(-1), _Vector(None, None, None)
    found = _decode(
        _engine(engine), prim_id, instance_id, ctypes.addressof(prim), ctypes.addressof(instancer), byref(index),
        byref(context),
    )
    if not found:
        return None
    text = lambda address: (_path_text(address) or b"").decode()
    levels = []
    if context.begin:
        # std::pair<SdfPath, int>: 8 + 4 bytes, padded to 12 (SdfPath is two 4-byte handles).
        for address in range(context.begin, context.end, 12):
            levels.append((text(address), c_int.from_address(address + 8).value))
    return {
        "prim": text(ctypes.addressof(prim)), "instancer": text(ctypes.addressof(instancer)), "index": index.value,
        "levels": levels,
    }
