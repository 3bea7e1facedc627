"""Rays against triangles: Embree's own library, called in packets from compiled loops.

The embreex wheel brings the library; its Python interface takes one ray at a time, a tenth as fast.
Here Python builds the hierarchy through ctypes, and numba kernels call `occluded16` and
`intersect16` with packets of their own, without the interpreter and from any thread.

Input  : triangles.    Output : an address that kernels trace against.
Cost   : building, about 0.1 µs per triangle; tracing, see tests/benchmarks.
Fails  : a ray through an edge may slip between two triangles unless they share its vertices.
"""

import ctypes
import importlib.util
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from capture.errors import InputError
from render.owner import Owner

PACKET = 16
"""Rays of one call."""

_ROBUST = 4  # RTC_SCENE_FLAG_ROBUST: watertight along shared edges
_QUICK, _THOROUGH = 0, 1  # RTC_BUILD_QUALITY_LOW, RTC_BUILD_QUALITY_MEDIUM
_TRIANGLES = 0  # RTC_GEOMETRY_TYPE_TRIANGLE
_INDEX, _VERTEX = 0, 1  # RTC_BUFFER_TYPE_…
_UINT3, _FLOAT3 = 0x5003, 0x9003  # RTC_FORMAT_…
_FIELDS = 12  # origin, near, direction, time, far, mask, id, flags: one vector of 16 each
_HIT_FIELDS = 10  # normal, u, v, triangle, geometry, instance, and one that later releases have
_ALIGNMENT = 64
_COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_ALL_FEATURES = 0xFFFFFFFF  # RTC_FEATURE_FLAG_ALL


class Occluders(Owner):
    """Triangles that rays may hit. Owns memory of Embree: use it as a context manager.

    Parameters
    ----------
    positions : (V, 3) float32
        In m.
    faces : (F, 3) int32
        May be empty: then nothing is ever hit.
    is_quick : bool
        Build five times as fast what is then traced a little slower: for what moves.
    is_watertight : bool
        Without it a quarter more rays are traced in a second, and one in a million slips between
        two triangles; of rays aimed at edges, one in twenty.

    Raises
    ------
    InputError
        If Embree refuses the triangles, for want of memory.
    """

    def __init__(
        self,
        positions: NDArray[np.float32],
        faces: NDArray[np.int32],
        *,
        is_quick: bool = False,
        is_watertight: bool = True,
    ) -> None:
        library = _library()
        # Embree reads 16 bytes where a vertex has 12.
        self._positions = np.zeros((len(positions) + 1, 3), np.float32)
        self._positions[:-1] = positions
        self._faces = np.ascontiguousarray(faces, np.uint32)
        self._device = library.rtcNewDevice(None)
        self._scene = library.rtcNewScene(self._device)
        library.rtcSetSceneFlags(self._scene, _ROBUST if is_watertight else 0)
        quality = _QUICK if is_quick else _THOROUGH
        library.rtcSetSceneBuildQuality(self._scene, quality)
        if len(faces):
            geometry = library.rtcNewGeometry(self._device, _TRIANGLES)
            for kind, form, array, count in (
                (_VERTEX, _FLOAT3, self._positions, len(positions)),
                (_INDEX, _UINT3, self._faces, len(faces)),
            ):
                library.rtcSetSharedGeometryBuffer(
                    geometry, kind, 0, form, array.ctypes.data, 0, 12, count
                )
            library.rtcSetGeometryBuildQuality(geometry, quality)
            library.rtcCommitGeometry(geometry)
            library.rtcAttachGeometry(self._scene, geometry)
            library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(self._scene)
        code = library.rtcGetDeviceError(self._device)
        if code:
            self.release()
            raise InputError(f"Embree cannot hold {len(faces)} triangles (its error {code})")

    @property
    def address(self) -> int:
        """What kernels pass on to `occluded16` and `intersect16`; good until `release`."""
        return int(self._scene)

    def release(self) -> None:
        """Free the hierarchy."""
        if self._scene:
            _library().rtcReleaseScene(self._scene)
            _library().rtcReleaseDevice(self._device)
        self._scene = self._device = 0


def occluded16_address() -> int:
    """Return the address of Embree's function, which kernels call through `occluded16`."""
    return _address(_library().rtcOccluded16)


def intersect16_address() -> int:
    """Return the address of Embree's function, which kernels call through `intersect16`."""
    return _address(_library().rtcIntersect16)


@njit(nogil=True)
def packet() -> tuple[Any, Any]:  # pragma: no cover - compiled
    """Return memory for a packet: rays (12, 16) float32 and valid (16,) int32, both all zeros.

    The rows of rays: origin x, y, z, near, direction x, y, z, time, far; then the bits of mask, id
    and flags. A ray that hits something comes back with far = −inf.
    """
    return _packet(_FIELDS)


@njit(nogil=True)
def hit_packet() -> tuple[Any, Any]:  # pragma: no cover - compiled
    """Return memory for a packet of `intersect16`: rays (22, 16) float32, valid (16,) int32.

    The first rows are those of `packet`. Below, the hit: the triangle's normal (12 to 14), not of
    unit length; u and v (15, 16), the shares of its second and third corner; the bits of its row in
    `faces` (17). Row 18 must hold the bits of −1 when the packet is traced, and holds others where
    something was hit; far is then the distance, in lengths of the direction.
    """
    return _packet(_FIELDS + _HIT_FIELDS)


@njit(nogil=True)
def _packet(fields: int) -> tuple[Any, Any]:  # pragma: no cover - compiled
    memory = np.zeros((fields + 1) * PACKET + _ALIGNMENT // 4, np.float32)
    first = (-memory.ctypes.data % _ALIGNMENT) // 4
    rays = memory[first : first + fields * PACKET].reshape(fields, PACKET)
    valid = memory[first + fields * PACKET :][:PACKET].view(np.int32)
    rays[9].view(np.int32)[:] = -1
    return rays, valid


@intrinsic
def occluded16(_typing: Any, function: Any, valid: Any, scene: Any, rays: Any) -> Any:
    """Trace the packet whose arrays lie at the addresses `rays` and `valid` (−1: trace, 0: not)."""
    return _call16()


@intrinsic
def coherent16(_typing: Any, function: Any, valid: Any, scene: Any, rays: Any) -> Any:
    """Do what the address's function does, two to three times as fast for rays that run alike."""
    return _call16(_COHERENT)


@intrinsic
def intersect16(_typing: Any, function: Any, valid: Any, scene: Any, rays: Any) -> Any:
    """Find the nearest hits of a `hit_packet`, whose arrays lie at the addresses given."""
    return _call16()


def _call16(flags: int = 0) -> Any:
    signature = types.void(types.int64, types.int64, types.int64, types.int64)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer, word = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [pointer] * 4)
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        passed = [builder.inttoptr(each, pointer) for each in arguments[1:]]
        # RTCIntersectArguments: flags, features, context, filter, function.
        content = ir.LiteralStructType([word, word, pointer, pointer, pointer])(
            [word(flags), word(_ALL_FEATURES), *3 * [ir.Constant(pointer, None)]]
        )
        options = context.insert_unique_const(builder.module, f"embree.arguments.{flags}", content)
        builder.call(target, [*passed, builder.bitcast(options, pointer)])
        return context.get_dummy_value()

    return signature, generate


def _address(function: Any) -> int:
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address


@cache
def _library() -> Any:
    spec = importlib.util.find_spec("embreex")
    beside = Path(str(spec and spec.origin)).parents[1] / "embreex.libs"
    for name in ("libtbb*", "libembree4*"):  # the second needs the first
        library = ctypes.CDLL(str(next(beside.glob(name))), mode=ctypes.RTLD_LOCAL)
    pointer, number = ctypes.c_void_p, ctypes.c_uint
    for name, result, arguments in (
        ("rtcNewDevice", pointer, [ctypes.c_char_p]),
        ("rtcGetDeviceError", ctypes.c_int, [pointer]),
        ("rtcReleaseDevice", None, [pointer]),
        ("rtcNewScene", pointer, [pointer]),
        ("rtcSetSceneFlags", None, [pointer, ctypes.c_int]),
        ("rtcSetSceneBuildQuality", None, [pointer, ctypes.c_int]),
        ("rtcCommitScene", None, [pointer]),
        ("rtcReleaseScene", None, [pointer]),
        ("rtcNewGeometry", pointer, [pointer, ctypes.c_int]),
        ("rtcSetGeometryBuildQuality", None, [pointer, ctypes.c_int]),
        ("rtcCommitGeometry", None, [pointer]),
        ("rtcReleaseGeometry", None, [pointer]),
        ("rtcAttachGeometry", number, [pointer, pointer]),
        (
            "rtcSetSharedGeometryBuffer",
            None,
            [pointer, ctypes.c_int, number, ctypes.c_int, pointer, *3 * [ctypes.c_size_t]],
        ),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
