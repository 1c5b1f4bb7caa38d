"""Examines meshes that the benchmark is to use: readable, of a plausible size, within the hand's power.

A mesh becomes an object (`scene.objects.from_mesh`), is dropped a number of times into the suite's own scene,
and the analysis of antipodal grasps looks at the height map of every pose in which it comes to rest.
Detectors and controllers have no say in it, and a scene that is played is never drawn again.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import msgspec
import mujoco

import mpgrasp
from mpgrasp.bench.meshes.facts import ObjectFacts
from mpgrasp.bench.meshes.files import ObjectFile
from mpgrasp.bench.results.provenance import sha256
from mpgrasp.bench.results.run_card import MeshCard
from mpgrasp.detectors.antipodal.analysis import antipodal_grasps
from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.exceptions import AssetError, ConfigError, SimulationError
from mpgrasp.files.cache import load_result, store_result
from mpgrasp.files.json_values import json_value
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.from_mesh import FRICTION, CachedBody, mesh_key, read_body
from mpgrasp.scene.objects.model import ObjectModel
from mpgrasp.scene.scene import build_scene

REST_POSES = 8
"""Number of times that an object is dropped, with the seeds 0, 1, 2, ..."""
SOME_GRASP = 0.1
"""Quality of the best grasp above which the hand can close on an object: no controller attempts less."""
SURE_GRASP = 0.5
"""The same where every pose must offer one."""
MAX_CONTACTS = 200
"""Most contacts of an object at rest; MuJoCo has memory for some 480, and a hand is yet to come."""


class _CachedPoses(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    qualities: tuple[Annotated[float, msgspec.Meta(ge=0, le=1)] | None, ...]


@dataclass(frozen=True, kw_only=True)
class MeshVerdict:
    """Result of the examination of one mesh."""

    name: str
    path: str
    sha256: str | None
    """Hash of the file; None where it cannot be read."""
    reason: str | None = None
    """Reason why it is not used; None if it is."""
    model: ObjectModel | None = None
    """The object, of what was accepted."""
    qualities: tuple[float | None, ...] = ()
    """Quality of the best grasp in each pose [0, 1]; None where the object did not come to rest."""

    @property
    def accepted(self) -> bool:
        """True if the benchmark uses it."""
        return self.model is not None

    def card(self) -> MeshCard:
        """The mesh as run.json describes it: by name and hash, since its folder is nobody's business."""
        model = self.model
        return MeshCard(
            name=self.name,
            file=Path(self.path).name,
            sha256=self.sha256,
            reason=self.reason,
            mass=None if model is None else model.mass,
            friction=None if model is None or model.friction == FRICTION else model.friction,
            size=None if model is None else model.size,
            pieces=None if model is None else len(model.parts),
            grasp_qualities=self.qualities,
        )


def examine(file: ObjectFile, scene: SceneConfig, density: float) -> MeshVerdict:
    """The verdict on one mesh; takes seconds unless it is cached.

    Args:
        file: where the mesh is.
        scene: what it would lie in; its own objects do not matter.
        density: [kg/m^3]
    """
    verdict = MeshVerdict(name=file.name, path=str(file.path), sha256=sha256(file.path))
    try:
        body = read_body(file.path, file.scale)
        facts = file.facts
        model = body.as_object(
            file.name,
            density=facts.density or density,
            mass=facts.mass,
            friction=facts.friction,
            provenance=f"mesh file {file.path.name}",
        )
        qualities = _best_grasps(model, scene, _poses_key(body.key, scene, density, facts))
    except (AssetError, ConfigError, SimulationError) as error:
        return replace(verdict, reason=str(error))
    except ValueError as error:  # how MuJoCo's compiler complains
        return replace(verdict, reason=f"MuJoCo cannot use it ({' '.join(str(error).split())})")
    verdict = replace(verdict, qualities=qualities)
    reason = _unfit(qualities, strict=file.strict)
    return replace(verdict, reason=reason) if reason else replace(verdict, model=model)


def is_cached(file: ObjectFile, scene: SceneConfig, density: float) -> bool:
    """True if `examine` has its answer at hand."""
    try:
        key = mesh_key(file.path, file.scale)
    except AssetError:
        return True
    mesh = load_result("meshes", key, CachedBody)
    return mesh is not None and (
        mesh.refused is not None or _cached_poses(_poses_key(key, scene, density, file.facts)) is not None
    )


def _best_grasps(model: ObjectModel, scene: SceneConfig, key: str) -> tuple[float | None, ...]:
    known = _cached_poses(key)
    if known is None:
        config = replace(scene, objects=(model,), count=None)
        known = _CachedPoses(qualities=tuple(_best_grasp(config, seed) for seed in range(REST_POSES)))
        store_result("rest_poses", key, known)
    return known.qualities


def _cached_poses(key: str) -> _CachedPoses | None:
    known = load_result("rest_poses", key, _CachedPoses)
    return known if known is not None and len(known.qualities) == REST_POSES else None


def _best_grasp(config: SceneConfig, seed: int) -> float | None:
    try:
        settled = build_scene(config, seed, robot=False)
    except ConfigError:  # it rolls, slides or rocks on
        return None
    data = settled.data()
    if data.ncon > MAX_CONTACTS:
        raise AssetError("too many contacts at rest", got=data.ncon, allowed=f"up to {MAX_CONTACTS}")
    return float(antipodal_grasps(settled.height_map(data=data)).quality.max())


def _poses_key(mesh: str, scene: SceneConfig, density: float, facts: ObjectFacts) -> str:
    """Hash of all that decides in which poses a mesh comes to rest and what the hand can do there."""
    decides = [
        mesh, facts.density or density, facts.mass, facts.friction, REST_POSES,
        replace(scene, objects=("it",), count=None), HandGeometry(), mujoco.__version__, mpgrasp.__version__,
    ]  # fmt: skip
    return hashlib.sha256(json.dumps(json_value(decides), sort_keys=True).encode()).hexdigest()


def _unfit(qualities: tuple[float | None, ...], *, strict: bool) -> str | None:
    """Reason why an object whose rest poses offer such grasps is not used; None if it is."""
    n = len(qualities)
    if all(quality is None for quality in qualities):
        return f"does not come to rest within the placing region; dropped {n} times"
    best = [quality or 0.0 for quality in qualities]
    if max(best) < SOME_GRASP:
        return f"the hand cannot close on it in any of {n} rest poses"
    good = sum(quality >= SURE_GRASP for quality in best)
    if strict and good < n:
        return f"a grasp of quality {SURE_GRASP:g} in only {good} of {n} rest poses, all are wanted"
    return None
