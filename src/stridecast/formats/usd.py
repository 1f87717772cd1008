"""USD: skeletons in motion as ``UsdSkel`` characters, one or a crowd of instances.

Metres, +Y up, a time code a frame. Needs the extra ``usd`` (usd-core). See Pixar's "UsdSkel" schema: joints are paths
of tokens, an animation holds the local transforms of all joints, and a crowd shares one prototype a body, each instance
bound to an animation of its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.errors import FileError, InputError
from stridecast.formats.files import replacing_path
from stridecast.model.mesh import SkinnedMesh
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

ENDINGS = (".usd", ".usda", ".usdc")
"""Text (``.usda``) or the binary crate (the others)."""

ALIKE = 1e-6
"""Bodies whose bones are alike to this share of their length are one body in different sizes."""

GREY = (0.55, 0.58, 0.62)
_REACH = 1.5
"""Nothing of a body is further from its root than so many times the farthest joint of the rest pose."""


Skin = SkinnedMesh | Callable[[Skeleton], SkinnedMesh]
"""A skin, or what makes one for a skeleton, such as ``mannequin``."""


def write_usd(path: str | Path, motion: Motion, *, skin: Skin | None = None) -> None:
    """Write one character.

    Parameters
    ----------
    path
        A file ``*.usda`` (text), ``*.usdc`` or ``*.usd`` (binary).
    motion
        The motion; at time code ``n`` is frame ``n``.
    skin
        Its skin; only a skeleton if left out.

    Raises
    ------
    FileError
        Another ending, usd-core is missing, or the file system refuses; what was there is untouched.
    """
    check_usd(path)
    scene = UsdScene(motion.frame_rate, crowd=False)
    scene.add(motion, name=motion.name or "Person", skin=skin)
    scene.save(path)


def check_usd(path: str | Path) -> None:
    """Raise the error that writing USD would raise before the work.

    Raises
    ------
    FileError
        Another ending, or usd-core is missing.
    """
    if Path(path).suffix.lower() not in ENDINGS:
        raise FileError(f"USD is written as {', '.join(f'*{ending}' for ending in ENDINGS)}", path=path)
    if find_spec("pxr") is None:
        raise FileError("is USD, which needs usd-core: pip install 'stridecast[usd]'", path=path)


class UsdScene:
    """People in motion on one clock, put into memory as they are added.

    Parameters
    ----------
    frame_rate
        Time codes a second.
    crowd
        Whether everybody is an instance of a body that is there once; else one person, written out.

    Raises
    ------
    InputError
        A frame rate that is not positive.
    FileError
        usd-core is missing.
    """

    def __init__(self, frame_rate: float, *, crowd: bool = True) -> None:
        if not (np.isfinite(frame_rate) and frame_rate > 0):
            raise InputError(f"the frame rate must be a positive number, not {frame_rate}")
        check_usd("scene.usd")
        from pxr import Sdf, Usd, UsdGeom

        self.frame_rate, self.crowd = float(frame_rate), crowd
        self.people = 0
        self._layer = Sdf.Layer.CreateAnonymous(".usd")
        self._stage = Usd.Stage.Open(self._layer)
        UsdGeom.SetStageMetersPerUnit(self._stage, UsdGeom.LinearUnits.meters)
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.y)
        self._stage.SetTimeCodesPerSecond(self.frame_rate)
        self._stage.SetFramesPerSecond(self.frame_rate)
        self._layer.documentation = "Written by stridecast: metres, +Y up, one time code a frame."
        self._end = 0.0
        self._begin = np.inf
        self._names: set[str] = set()
        self._bodies: list[tuple[Skeleton, Skin | None, str]] = []
        if crowd:
            self._stage.SetDefaultPrim(UsdGeom.Xform.Define(self._stage, "/Crowd").GetPrim())

    def add(self, motion: Motion, *, name: str = "Person", start: float = 0.0, skin: Skin | None = None) -> str:
        """Add somebody.

        Parameters
        ----------
        motion
            The motion.
        name
            What they are called; characters that USD does not take become ``_``, and who is called as somebody else is
            gets a number.
        start
            When the motion begins, seconds. Somebody in a crowd is invisible before and afterwards.
        skin
            Skin of the body. People with alike bodies share the skin of the first.

        Returns
        -------
        Path of the prim that moves the body.

        Raises
        ------
        InputError
            A start that is not finite, or a second person where there is no crowd.
        """
        if not np.isfinite(start):
            raise InputError(f"the start must be a number of seconds, not {start}")
        if not self.crowd and self.people:
            raise InputError("a scene without crowd holds one person")
        label = self._name(name)
        times = (start + np.arange(motion.frames) / motion.frame_rate) * self.frame_rate
        times = np.where(np.abs(times - np.round(times)) < 1e-6, np.round(times), times)
        place = self._instance(label, motion, skin) if self.crowd else self._alone(label, motion, skin)
        if self.crowd:
            self._show(place, times)
        prim = self._stage.GetPrimAtPath(place)
        prim.SetCustomDataByKey("stridecast", {"name": name, "start": float(start), "frames": motion.frames})
        self.people += 1
        self._begin, self._end = min(self._begin, float(times[0])), max(self._end, float(times[-1]))
        self._animate(f"{place}/Animation", motion, times, *self._frame_of(place))
        return place

    def save(self, path: str | Path) -> None:
        """Write the scene.

        Raises
        ------
        FileError
            Another ending, or the file system refuses; what was there is untouched.
        """
        check_usd(path)
        self._stage.SetStartTimeCode(self._begin if self.people else 0.0)
        self._stage.SetEndTimeCode(self._end)
        from pxr import Tf

        with replacing_path(path) as temporary:
            try:
                done = self._layer.Export(str(temporary))
            except Tf.ErrorException as error:
                raise OSError(str(error).splitlines()[0]) from None
            if not done:
                raise OSError("the USD library refused")

    def _name(self, name: str) -> str:
        label = _identifier(name)
        if label.casefold() in self._names:
            label = next(
                w for k in range(2, len(self._names) + 3) if (w := f"{label}_{k}").casefold() not in self._names
            )
        self._names.add(label.casefold())
        return label

    def _alone(self, label: str, motion: Motion, skin: Skin | None) -> str:
        """One person as a skeleton root of their own."""
        place = f"/{label}"
        self._body(place, motion.skeleton, skin)
        prim = self._stage.GetPrimAtPath(place)
        self._stage.SetDefaultPrim(prim)
        self._place(prim, motion, 1.0)
        self._bind(prim, place)
        return place

    def _instance(self, label: str, motion: Motion, skin: Skin | None) -> str:
        """One of a crowd: moved and sized outside of the instance, posed by an animation of their own."""
        from pxr import UsdGeom, UsdSkel

        body, size = self._body_like(motion.skeleton, skin)
        place = f"/Crowd/{label}"
        self._place(UsdGeom.Xform.Define(self._stage, place).GetPrim(), motion, size)
        root = UsdSkel.Root.Define(self._stage, f"{place}/Body").GetPrim()
        root.GetReferences().AddInternalReference(body)
        root.SetInstanceable(True)
        self._bind(root, place)
        self._extent(root, motion, size)
        return place

    def _body_like(self, skeleton: Skeleton, skin: Skin | None) -> tuple[str, float]:
        """The prototype of a body and the size of this one; a new prototype where nobody is alike."""
        for known, _, place in self._bodies:
            if known.names == skeleton.names and np.array_equal(known.parents, skeleton.parents):
                size = float(np.linalg.norm(skeleton.offsets)) / max(float(np.linalg.norm(known.offsets)), 1e-12)
                if np.abs(skeleton.offsets - size * known.offsets).max() < ALIKE * np.abs(skeleton.offsets).max():
                    return place, size
        from pxr import Sdf

        place = f"/_Body{len(self._bodies)}"
        self._body(place, skeleton, skin)
        self._stage.GetPrimAtPath(place).SetSpecifier(Sdf.SpecifierClass)
        self._bodies.append((skeleton, skin, place))
        return place, 1.0

    def _body(self, place: str, skeleton: Skeleton, skin: Skin | None) -> None:
        """Define a skeleton root with its skeleton and skin."""
        from pxr import Gf, UsdSkel, Vt

        UsdSkel.Root.Define(self._stage, place)
        usd = UsdSkel.Skeleton.Define(self._stage, f"{place}/Skeleton")
        usd.CreateJointsAttr(Vt.TokenArray(_joint_paths(skeleton)))
        usd.CreateJointNamesAttr(Vt.TokenArray(list(skeleton.names)))
        rest = kinematics.rest(skeleton)
        mesh = skin(skeleton) if callable(skin) else skin
        at = rest.positions if mesh is None else mesh.bind_positions
        turned = rest.rotations if mesh is None else mesh.bind_rotations
        usd.CreateBindTransformsAttr(Vt.Matrix4dArray([_matrix(Gf, *pair) for pair in zip(at, turned, strict=True)]))
        still = [_matrix(Gf, offset, np.array([1.0, 0.0, 0.0, 0.0])) for offset in skeleton.offsets]
        usd.CreateRestTransformsAttr(Vt.Matrix4dArray(still))
        UsdSkel.BindingAPI.Apply(usd.GetPrim())
        if mesh is not None:
            self._skin(f"{place}/Skin", f"{place}/Skeleton", mesh)

    def _skin(self, place: str, skeleton: str, skin: SkinnedMesh) -> None:
        from pxr import Gf, UsdGeom, UsdSkel, Vt

        mesh = UsdGeom.Mesh.Define(self._stage, place)
        points = np.ascontiguousarray(skin.positions, np.float32)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(skin.normals, np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(skin.triangles), 3, np.int32)))
        corners = np.ascontiguousarray(skin.triangles, np.int32).reshape(-1)
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack((points.min(axis=0), points.max(axis=0)))))
        mesh.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*GREY)]))
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        width = skin.joints.shape[1]
        joints = np.ascontiguousarray(skin.joints, np.int32).reshape(-1)
        weights = np.ascontiguousarray(skin.weights, np.float32).reshape(-1)
        binding.CreateJointIndicesPrimvar(False, width).Set(Vt.IntArray.FromNumpy(joints))
        binding.CreateJointWeightsPrimvar(False, width).Set(Vt.FloatArray.FromNumpy(weights))
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
        binding.CreateSkeletonRel().SetTargets([skeleton])

    def _place(self, prim: Any, motion: Motion, size: float) -> None:
        """Put the prim where the motion begins: single precision is then fine enough for what the body does."""
        from pxr import Gf, UsdGeom

        begin = motion.root_positions[0].round(3)
        moved = UsdGeom.Xformable(prim)
        moved.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(float(begin[0]), 0.0, float(begin[2])))
        moved.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(size, size, size))
        if not self.crowd:
            self._extent(prim, motion, size)

    def _frame_of(self, place: str) -> tuple[Float[Array, "3"], float]:
        """Where a prim has been put, and its size."""
        prim = self._stage.GetPrimAtPath(place)
        begin = np.array(prim.GetAttribute("xformOp:translate").Get())
        return begin, float(prim.GetAttribute("xformOp:scale").Get()[0])

    def _extent(self, root: Any, motion: Motion, size: float) -> None:
        """A box around everything that the body does, in the frame of its prim."""
        from pxr import UsdSkel, Vt

        begin = motion.root_positions[0].round(3) * np.array([1.0, 0.0, 1.0])
        places: Array = (motion.root_positions - begin) / size
        longest = float(np.abs(kinematics.rest(motion.skeleton).positions).max()) / size
        around = np.array([[-_REACH * longest], [_REACH * longest]])
        box = (np.stack((places.min(axis=0), places.max(axis=0))) + around).astype(np.float32)
        UsdSkel.Root(root).CreateExtentAttr(Vt.Vec3fArray.FromNumpy(box))

    def _bind(self, root: Any, place: str) -> None:
        from pxr import UsdSkel

        UsdSkel.Animation.Define(self._stage, f"{place}/Animation")
        UsdSkel.BindingAPI.Apply(root).CreateAnimationSourceRel().SetTargets([f"{place}/Animation"])

    def _show(self, place: str, times: Float[Array, "frames"]) -> None:
        from pxr import UsdGeom

        seen = UsdGeom.Imageable(self._stage.GetPrimAtPath(place)).CreateVisibilityAttr()
        if times[0] > 0.0:
            seen.Set(UsdGeom.Tokens.invisible, min(0.0, times[0] - 1.0))
        seen.Set(UsdGeom.Tokens.inherited, times[0])
        seen.Set(UsdGeom.Tokens.invisible, times[-1] + 1.0)

    def _animate(
        self, place: str, motion: Motion, times: Float[Array, "frames"], begin: Float[Array, "3"], size: float
    ) -> None:
        """Write the samples straight into the layer: many times as fast as through the stage."""
        from pxr import Gf, Sdf, UsdSkel, Vt

        skeleton = motion.skeleton
        animation = UsdSkel.Animation(self._stage.GetPrimAtPath(place))
        animation.CreateJointsAttr(Vt.TokenArray(_joint_paths(skeleton)))
        animation.CreateScalesAttr(Vt.Vec3hArray(skeleton.joints, Gf.Vec3h(1.0)))
        moved = animation.CreateTranslationsAttr().GetPath()
        turned = animation.CreateRotationsAttr().GetPath()
        places = np.repeat((skeleton.offsets / size)[None].astype(np.float32), motion.frames, axis=0)
        places[:, 0] = (motion.root_positions - begin) / size
        turns = np.ascontiguousarray(motion.rotations[..., [1, 2, 3, 0]], np.float32)  # the real part comes last
        with Sdf.ChangeBlock():
            for time, where, how in zip(times.tolist(), places, turns, strict=True):
                self._layer.SetTimeSample(moved, time, Vt.Vec3fArray.FromNumpy(where))
                self._layer.SetTimeSample(turned, time, Vt.QuatfArray.FromNumpy(how))


def _identifier(name: str) -> str:
    """A name that USD takes for a prim or joint."""
    label = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")[:80] or "Person"
    return f"_{label}" if label[0].isdigit() else label


def _joint_paths(skeleton: Skeleton) -> list[str]:
    """Joints as paths of their names from the root; names that become alike get numbers."""
    own: list[str] = []
    for joint, name in enumerate(skeleton.names):
        label = _identifier(name)
        own.append(label if label not in own else f"{label}_{joint}")
    paths: list[str] = []
    for joint, parent in enumerate(skeleton.parents.tolist()):
        paths.append(own[joint] if parent < 0 else f"{paths[parent]}/{own[joint]}")
    return paths


def _matrix(gf: Any, place: Float[Array, "3"], turn: Float[Array, "4"]) -> Any:
    w, x, y, z = (float(part) for part in turn)
    out = gf.Matrix4d(1.0).SetRotate(gf.Quatd(w, x, y, z))
    return out.SetTranslateOnly(gf.Vec3d(*(float(part) for part in place)))
