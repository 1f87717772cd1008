from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blenders import run_in_blender
from bodies import humanoid, standing, writhing
from stridecast.body import kinematics
from stridecast.errors import FileError, InputError
from stridecast.formats.motion_files import write_motion
from stridecast.formats.usd import UsdScene, write_usd
from stridecast.geometry import quaternions as quat
from stridecast.model.mesh import SkinnedMesh
from stridecast.model.motion import Motion

pxr = pytest.importorskip("pxr", reason="no usd-core (pip install 'stridecast[usd]')")

AGREE = 1e-5
"""What the USD library makes of a file is where our kinematics has it, metres."""

HEIGHTS = (1.0, 0.9, 1.1, 1.0)


def people() -> list[tuple[Motion, float]]:
    return [(writhing(humanoid(k), frames=30, seed=n), 0.4 * n) for n, k in enumerate(HEIGHTS)]


def crowd(path: Path) -> list[tuple[Motion, float]]:
    scene, all_ = UsdScene(30.0), people()
    for motion, start in all_:
        scene.add(motion, name="Ann", start=start)
    scene.save(path)
    return all_


def opened(path: Path):
    from pxr import Usd

    return Usd.Stage.Open(str(path))


def complaints(path: Path) -> list[str]:
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(opened(path))
    return [f"{error.GetName()}: {error.GetMessage()}" for error in errors]


def joints(stage) -> dict[str, object]:
    """By skeleton: a function of the time code to world places of the joints, as UsdSkel computes them."""
    from pxr import Usd, UsdGeom, UsdSkel

    cache, out = UsdSkel.Cache(), {}
    every = list(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in every:
        if prim.IsA(UsdSkel.Root):
            cache.Populate(UsdSkel.Root(prim), Usd.TraverseInstanceProxies())
    for prim in every:
        if prim.IsA(UsdSkel.Skeleton):
            query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))

            def places(code: float, query=query, prim=prim, stage=stage) -> np.ndarray:
                # of an instance: the query is that of the prototype, its place in the world is the instance's
                world = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(prim))
                return (np.array(query.ComputeJointSkelTransforms(code)) @ world)[:, 3, :3]

            out[str(prim.GetPath())] = places
    return out


@pytest.mark.parametrize("ending", ["usd", "usda", "usdc"])
def test_joints_are_where_ours_are(tmp_path, ending):
    motion = writhing(frames=40)
    far = replace(motion, root_positions=motion.root_positions + np.array([900.0, 0.0, -700.0]))
    for name, take in (("near", motion), ("far", far)):
        path = tmp_path / f"{name}.{ending}"
        write_motion(path, take)
        stage = opened(path)
        (places,) = joints(stage).values()
        ours = kinematics.pose(take).positions
        assert np.abs(np.array([places(n) for n in range(40)]) - ours).max() < AGREE
        assert not complaints(path)
    assert (path.read_bytes()[:8] == b"PXR-USDC") == (ending != "usda")


def test_conventions_are_said(tmp_path):
    from pxr import UsdGeom, UsdSkel

    write_usd(tmp_path / "a.usdc", replace(standing(frames=50, frame_rate=25.0), name="Ann walks!"))
    stage = opened(tmp_path / "a.usdc")
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert (stage.GetTimeCodesPerSecond(), stage.GetFramesPerSecond()) == (25.0, 25.0)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 49.0)
    assert stage.GetDefaultPrim().GetName() == "Ann_walks"
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Ann_walks/Skeleton"))
    assert list(skeleton.GetJointNamesAttr().Get()) == list(humanoid().names)
    assert skeleton.GetJointsAttr().Get()[3] == "Hips/Spine/Spine1/Chest"


def test_a_crowd_shares_its_bodies(tmp_path):
    from pxr import Usd, UsdGeom

    all_ = crowd(tmp_path / "a.usdc")
    stage = opened(tmp_path / "a.usdc")
    assert not complaints(tmp_path / "a.usdc")
    assert len(stage.GetPrototypes()) == 1
    found = joints(stage)
    assert list(found) == [f"/Crowd/Ann{end}/Body/Skeleton" for end in ("", "_2", "_3", "_4")]
    for (motion, start), places in zip(all_, found.values(), strict=True):
        ours = kinematics.pose(motion).positions
        assert np.abs(np.array([places(30 * start + n) for n in range(30)]) - ours).max() < AGREE
    third = UsdGeom.Imageable(stage.GetPrimAtPath("/Crowd/Ann_3"))
    seen = [third.ComputeVisibility(code) != "invisible" for code in (0, 23, 24, 53, 54)]
    assert seen == [False, False, True, True, False]
    assert stage.GetPrimAtPath("/Crowd/Ann_3").GetCustomDataByKey("stridecast")["start"] == pytest.approx(0.8)
    assert stage.GetEndTimeCode() == pytest.approx(36 + 29)
    assert stage.GetPrimAtPath("/Crowd/Ann/Body").IsInstance()
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetPrim().GetName() == "Crowd"


def test_other_bodies_are_other_prototypes(tmp_path):
    scene = UsdScene(30.0)
    lanky = humanoid()
    offsets = lanky.offsets.copy()
    offsets[lanky.chain("left_shin", "right_shin")] *= 1.3
    motions = [standing(), standing(replace(lanky, offsets=offsets)), standing()]
    for motion in motions:
        scene.add(motion)
    scene.save(tmp_path / "a.usda")
    stage = opened(tmp_path / "a.usda")
    assert len(stage.GetPrototypes()) == 2
    for motion, places in zip(motions, joints(stage).values(), strict=True):
        assert np.abs(places(3) - kinematics.pose(motion).positions[3]).max() < AGREE


def prisms(motion: Motion) -> SkinnedMesh:
    """A skin of a triangle a joint, bound in the pose of the first frame, which is not the rest pose."""
    world = kinematics.forward(motion.skeleton, np.zeros(3), motion.rotations[0])
    count = motion.skeleton.joints
    corner = 0.05 * np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    weights = np.zeros((3 * count, 4))
    weights[:, 0] = 1.0
    return SkinnedMesh(
        positions=(world.positions[:, None] + corner).reshape(-1, 3),
        normals=np.tile([0.0, 0.0, 1.0], (3 * count, 1)),
        triangles=np.arange(3 * count).reshape(-1, 3),
        joints=np.repeat(np.arange(count), 3)[:, None] * np.array([1, 0, 0, 0]),
        weights=weights,
        bind_positions=world.positions,
        bind_rotations=world.rotations,
    )


@pytest.mark.parametrize("many", [False, True])
def test_skins_follow_their_joints(tmp_path, many):
    from pxr import Usd, UsdGeom, UsdSkel, Vt

    motion = writhing(frames=10)
    skin, path = prisms(motion), tmp_path / "a.usdc"
    if many:
        scene = UsdScene(30.0)
        for _ in range(2):
            scene.add(motion, skin=skin)
        scene.save(path)
    else:
        write_usd(path, motion, skin=skin)
    assert not complaints(path)
    stage = opened(path)
    root = UsdSkel.Root(stage.GetPrimAtPath("/Crowd/Person/Body" if many else "/writhing"))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.TraverseInstanceProxies())
    (binding,) = cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies())
    query = cache.GetSkelQuery(binding.GetSkeleton())
    (target,) = binding.GetSkinningTargets()
    points = Vt.Vec3fArray(UsdGeom.Mesh(target.GetPrim()).GetPointsAttr().Get())
    assert target.ComputeSkinnedPoints(query.ComputeSkinningTransforms(7.0), points, 7.0)
    world = np.array(UsdGeom.XformCache(7.0).GetLocalToWorldTransform(root.GetPrim()))
    there = np.array(points) @ world[:3, :3] + world[3, :3]
    pose = kinematics.pose(motion)
    local = quat.rotate(
        quat.inverse(skin.bind_rotations)[:, None], (skin.positions.reshape(-1, 3, 3) - skin.bind_positions[:, None])
    )
    ours = pose.positions[7][:, None] + quat.rotate(pose.rotations[7][:, None], local)
    np.testing.assert_allclose(there, ours.reshape(-1, 3), atol=2e-5)


def test_writing_is_fast_and_small(tmp_path):
    motion = writhing(frames=3000)
    began = time.perf_counter()
    write_usd(tmp_path / "a.usdc", motion)
    assert time.perf_counter() - began < 3.0  # measured: 0.03 s
    raw = 3000 * motion.skeleton.joints * (3 + 4) * 4
    assert (tmp_path / "a.usdc").stat().st_size < 1.15 * raw


def test_names_that_usd_does_not_take(tmp_path):
    skeleton = replace(humanoid(), names=("1 Hüfte", "1-H fte", *humanoid().names[2:]))
    motion = replace(standing(skeleton), name="7/../ö")
    write_usd(tmp_path / "a.usda", motion)
    (places,) = joints(opened(tmp_path / "a.usda")).values()
    assert np.abs(places(0) - kinematics.pose(motion).positions[0]).max() < AGREE
    assert not complaints(tmp_path / "a.usda")


def test_refusals_change_nothing(tmp_path, monkeypatch):
    path = tmp_path / "a.usdc"
    with pytest.raises(FileError, match=r"a.usdz: USD is written as \*.usd, \*.usda, \*.usdc"):
        write_usd(tmp_path / "a.usdz", standing())
    with pytest.raises(FileError, match="no such folder"):
        write_usd(tmp_path / "none" / "a.usdc", standing())
    with pytest.raises(InputError, match="frame rate must be a positive number"):
        UsdScene(0.0)
    scene = UsdScene(30.0, crowd=False)
    with pytest.raises(InputError, match="start must be a number"):
        scene.add(standing(), start=np.nan)
    scene.add(standing())
    with pytest.raises(InputError, match="holds one person"):
        scene.add(standing())
    path.write_text("old")
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(FileError, match=r"a\.usdc: cannot be written: No space left"):
        scene.save(path)
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["a.usdc"]
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.setattr("stridecast.formats.usd.find_spec", lambda _: None)
    with pytest.raises(FileError, match=r"needs usd-core: pip install 'stridecast\[usd\]'"):
        write_usd(path, standing())


IMPORTED = """
import json, sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=sys.argv[1], support_scene_instancing=False)
figures = sorted((o for o in bpy.data.objects if o.type == "ARMATURE"), key=lambda o: o.name)
said = {}
for code in json.loads(sys.argv[2]):
    bpy.context.scene.frame_set(code)
    said[code] = [{b.name: list(o.matrix_world @ b.head) for b in o.pose.bones} for o in figures]
json.dump(said, open(sys.argv[3], "w"))
"""


@pytest.mark.parametrize("many", [False, True])
def test_blender_has_joints_where_ours_are(tmp_path, blender, many):
    path = tmp_path / "a.usdc"
    if many:
        all_ = crowd(path)
    else:
        all_ = [(writhing(frames=30), 0.0)]
        write_usd(path, all_[0][0])
    codes = list(range(0, 30, 3))
    said = run_in_blender(blender, IMPORTED, tmp_path, str(path), str(codes))
    for n, (motion, start) in enumerate(all_):
        ours = kinematics.pose(motion).positions
        for code in codes:
            frame = code - round(30 * start)
            if 0 <= frame < motion.frames:
                places = np.array([said[str(code)][n][name] for name in motion.skeleton.names])
                there = places[:, [0, 2, 1]] * [1.0, 1.0, -1.0]  # Blender's z is up
                assert np.abs(there - ours[frame]).max() < 1e-3
