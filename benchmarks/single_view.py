"""Best grasps of single views: what detectors propose, and how each ends in the true scene.

Every detector sees the same noisy views of held-out scenes. Its best grasp of each is judged against the
labels and executed by the free-flying gripper.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass

import mujoco
import numpy as np
import study

from mpgrasp.detectors.detector import GraspDetector, reads_truth
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, best_pixel, peak_height
from mpgrasp.motion.lift_trial import LiftRig
from mpgrasp.scene.scene import Scene
from mpgrasp.training.claims import stored_frame
from mpgrasp.training.data.views import make_scene
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.metrics import match_labels

STEEP = 0.5
"""A contact carries when its normal is at least so much upright (its z component)."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A detector's best grasp of a view, and what the labels say of it."""

    detector: str
    image: int
    """Number of the view in the data set."""
    scene: int
    camera_height: float
    """Over the table [m]."""
    thin: bool
    """True if the scene rises no higher than 13 mm."""
    graspable: bool
    """True if the view has a labelled grasp."""
    quality: float
    """Claimed for the best grasp [0, 1]."""
    peak_height: float
    """Value that exist_peak() holds against its threshold."""
    hit: bool
    rectangle: bool
    """True if the grasp is right by the rectangle metric."""


@dataclass(frozen=True, kw_only=True)
class Trial(Claim):
    """A claim and what came of it in the true scene."""

    stacked: bool
    """True if an object of the scene lies on another."""
    outcome: str
    """Outcome of the lift; "no_grasp" where the quality was zero everywhere."""
    lifted: bool


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A detector's best grasp of a view, before it is executed."""

    claim: Claim
    scene: tuple[int, int]
    """Seed of the data set, number of the scene."""
    grasp: Grasp | None
    """None where the quality is zero everywhere."""


def propose(
    detectors: Mapping[str, GraspDetector], dataset: GraspDataset, images: Iterable[int]
) -> list[Proposal]:
    """The best grasp of every detector in every image, judged against the labels."""
    thin, height = (_column(dataset, name) for name in ("thin", "camera_height"))
    told = any(map(reads_truth, detectors.values()))
    proposals, before, truth = [], None, None
    for i in images:
        scene, sample = dataset.scene(i), dataset.sample(i)
        if told and scene != before:
            before, truth = scene, make_scene(*scene)[0].height_map()
        frame = stored_frame(dataset, i)
        for name, detector in detectors.items():
            detector.reset(truth if reads_truth(detector) else None)
            found = detector.predict(frame)
            labels = sample.resized(len(found.quality))
            match = match_labels(found.quality, found.angle, found.width, labels)
            grasp = found.grasp_at(*best_pixel(found.quality))
            claim = Claim(
                detector=name,
                image=i,
                scene=scene[1],
                camera_height=float(height[i]),
                thin=bool(thin[i] > 0.5),
                graspable=bool(sample.quality.any()),
                quality=grasp.quality,
                peak_height=peak_height(found.quality),
                hit=match.hit,
                rectangle=match.rectangle,
            )
            there = grasp.quality > 0 and bool(np.isfinite(grasp.position).all())
            proposals.append(Proposal(claim=claim, scene=scene, grasp=grasp if there else None))
    return proposals


def _column(dataset: GraspDataset, name: str) -> FloatArray:
    values = dataset.column(name)
    if values is None:
        raise ConfigError("data without a column that the study needs", got=dataset.columns, allowed=name)
    return values


def execute(proposals: Sequence[Proposal], workers: int) -> list[Trial]:
    """The trials of all proposals, in their order."""
    scenes: dict[tuple[int, int], list[int]] = {}
    for k, proposal in enumerate(proposals):
        scenes.setdefault(proposal.scene, []).append(k)
    jobs = [(scene, [proposals[k].grasp for k in members]) for scene, members in scenes.items()]
    trials: dict[int, Trial] = {}
    with multiprocessing.get_context("spawn").Pool(workers) if workers > 1 else _Here() as pool:
        results = study.track(pool.imap(lift_all, jobs), "lifts", len(jobs))
        for members, (stacked, outcomes) in zip(scenes.values(), results, strict=True):
            for k, outcome in zip(members, outcomes, strict=True):
                trials[k] = Trial(
                    **asdict(proposals[k].claim),
                    stacked=stacked,
                    outcome=outcome,
                    lifted=outcome == "success",
                )
    return [trials[k] for k in range(len(proposals))]


class _Here:
    """A pool without processes."""

    imap = staticmethod(map)

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def lift_all(job: tuple[tuple[int, int], list[Grasp | None]]) -> tuple[bool, list[str]]:
    """True if things lie on each other in a scene, and the outcomes of grasps in it ("no_grasp" of None)."""
    (seed, index), grasps = job
    scene, _ = make_scene(seed, index)
    rig = LiftRig(scene)
    return is_stacked(scene), ["no_grasp" if g is None else rig.attempt(g).outcome for g in grasps]


def is_stacked(scene: Scene) -> bool:
    """True if some object carries another in the settled scene."""
    model, data = scene.model, scene.data()
    mujoco.mj_forward(model, data)
    owner = {model.body(name).id for name in scene.objects}
    for contact in data.contact:
        bodies = {int(model.geom_bodyid[g]) for g in contact.geom}
        if len(bodies) == 2 and bodies <= owner and abs(contact.frame[2]) > STEEP:
            return True
    return False
