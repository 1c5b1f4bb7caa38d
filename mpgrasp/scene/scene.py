"""A scene: arena, cloth, objects at rest and the Panda, as a function of a config and a seed alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.height_map import HeightMap
from mpgrasp.linear_algebra import product
from mpgrasp.paths import SCENES
from mpgrasp.robot.panda import PREFIX, panda_spec, set_home
from mpgrasp.scene.cloth import RGBA as CLOTH_RGBA
from mpgrasp.scene.cloth import Cloth, add_cloth, make_cloth, make_wrinkles
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.catalogue import load_object
from mpgrasp.scene.objects.free_body import add_object
from mpgrasp.scene.objects.model import OBJECT_GROUP, ObjectModel
from mpgrasp.scene.settling import Settler
from mpgrasp.scene.solver import set_in_motion
from mpgrasp.scene.watch import forward
from mpgrasp.workspace import WORKSPACE_CENTRE

_WRINKLE_STREAM = 14  # of the seed, beside those of scene and episode
_SKY = 2.0  # [m], height from which the rays of a height map are cast
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""Parts of MuJoCo's state that `Scene.state` holds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A settled world, ready to be simulated."""

    model: mujoco.MjModel
    spec: mujoco.MjSpec
    """Source of the compiled model, objects in the poses at rest."""
    state: FloatArray
    """Integration state (mjSTATE_INTEGRATION) at time 0: objects at rest, the arm at home."""
    objects: tuple[str, ...]
    """Names of the objects' bodies."""
    object_models: tuple[ObjectModel, ...]
    cloth: Cloth
    config: SceneConfig
    seed: int

    def data(self) -> mujoco.MjData:
        """Fresh data in the settled state, kinematics computed."""
        data = mujoco.MjData(self.model)
        mujoco.mj_setState(self.model, data, self.state, STATE)
        forward(self.model, data)
        return data

    def height_map(
        self, cell: float = 0.002, half_extent: float = 0.35, data: mujoco.MjData | None = None
    ) -> HeightMap:
        """True shape of the scene seen from above, without the robot.

        Args:
            cell: edge of a cell [m].
            half_extent: the map reaches this far from the workspace centre [m].
            data: the state to look at, kinematics computed; the settled one by default.
        """
        n = int(np.floor(half_extent / cell + 1e-9))
        axis = np.arange(-n, n + 1) * cell
        x, y = WORKSPACE_CENTRE[0] + axis, WORKSPACE_CENTRE[1] + axis
        support = self.cloth.height(x[None, :], y[:, None])
        height, label = support.copy(), np.zeros(support.shape, int)
        data = self.data() if data is None else data
        mine = np.array([self.objects.index(b) + 1 if b in self.objects else 0 for b in self._body_names()])
        group = np.zeros(6, np.uint8)
        group[OBJECT_GROUP] = 1
        down, hit = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
        for row, col in zip(*np.nonzero(self._shadow(data, x, y)), strict=True):
            # vertical rays: those of mj_multiRay leave from one point and would lean
            distance = mujoco.mj_ray(
                self.model, data, np.array([x[col], y[row], _SKY]), down, group, True, -1, hit
            )
            if distance >= 0 and _SKY - distance > height[row, col]:
                height[row, col] = _SKY - distance
                label[row, col] = mine[self.model.geom_bodyid[hit[0]]]
        x0, y0 = float(x[0]), float(y[0])
        return HeightMap(height=height, support=support, label=label, x0=x0, y0=y0, cell=cell)

    def _body_names(self) -> list[str]:
        return [self.model.body(k).name for k in range(self.model.nbody)]

    def _shadow(self, data: mujoco.MjData, x: FloatArray, y: FloatArray) -> np.ndarray:
        """(ny, nx) cells under the bounding boxes of the objects' geoms."""
        shadow = np.zeros((len(y), len(x)), bool)
        for geom in np.flatnonzero(self.model.geom_group == OBJECT_GROUP):
            R = data.geom_xmat[geom].reshape(3, 3)
            centre = data.geom_xpos[geom] + product(R, self.model.geom_aabb[geom, :3])
            reach = product(np.abs(R), self.model.geom_aabb[geom, 3:])
            shadow[np.ix_(np.abs(y - centre[1]) <= reach[1], np.abs(x - centre[0]) <= reach[0])] = True
        return shadow


def build_scene(config: SceneConfig, seed: int, *, robot: bool = True) -> Scene:
    """Build the scene of that seed and let it settle.

    The objects settle in a world without the robot, so that with and without it they lie the same.

    Raises:
        ConfigError: a negative seed, an unknown object, or objects that cannot come to rest in the region.
        AssetError: an object or the robot whose files cannot be used.
        SimulationError: MuJoCo has warned while the objects came to rest, as of too many contacts.
    """
    if seed < 0:
        raise ConfigError("unusable seed", got=seed, allowed="0 or above")
    # one stream per purpose: the cloth of a seed does not change with the number of objects on it
    draw, weave, drop = (np.random.default_rng([seed, stream]) for stream in range(3))
    models = _draw_objects(config, draw)
    names = _unique_names(models)
    cloth = make_cloth(config.cloth_unevenness, config.cloth_wavelength, weave, _draw_wrinkles(config, seed))

    spec = _arena(config, cloth)
    for name, model in zip(names, models, strict=True):
        add_object(spec, model, name=name)
    settler = Settler(model=spec.compile(), names=names, objects=models, cloth=cloth, config=config, rng=drop)
    place = {"scatter": settler.scatter, "pile": settler.pile, "stack": settler.stack}[config.placing]
    poses = place()

    spec = _arena(config, cloth)
    if robot:
        spec.attach(panda_spec(), prefix=PREFIX, frame=spec.worldbody.add_frame())
        set_in_motion(spec)
    for name, model, pose in zip(names, models, poses, strict=True):
        add_object(spec, model, pose[:3], pose[3:], name=name)
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    if robot:
        set_home(compiled, data)
    forward(compiled, data)
    state = np.empty(mujoco.mj_stateSize(compiled, STATE))
    mujoco.mj_getState(compiled, data, state, STATE)
    state.setflags(write=False)
    return Scene(
        model=compiled,
        spec=spec,
        state=state,
        objects=names,
        object_models=models,
        cloth=cloth,
        config=config,
        seed=seed,
    )


def _arena(config: SceneConfig, cloth: Cloth) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_file(str(SCENES / "table.xml"))
    add_cloth(spec, cloth)
    if config.basket:
        basket = mujoco.MjSpec.from_file(str(SCENES / "basket.xml"))
        spec.attach(basket, prefix="basket/", frame=spec.worldbody.add_frame())
    return spec


def _draw_wrinkles(config: SceneConfig, seed: int) -> FloatArray | None:
    """Return the heights (n, n) of the cloth's wrinkles [m]; None without any."""
    if config.cloth_wrinkles == 0:
        return None
    rng = np.random.default_rng([seed, _WRINKLE_STREAM])
    return make_wrinkles(config.cloth_wrinkles, config.cloth_wrinkle_width, config.cloth_wrinkle_count, rng)


def _draw_objects(config: SceneConfig, rng: np.random.Generator) -> tuple[ObjectModel, ...]:
    chosen = config.objects
    if config.count is not None:
        chosen = tuple(chosen[k] for k in rng.permutation(len(chosen))[: config.count])
    models = tuple(load_object(o) if isinstance(o, str) else o for o in chosen)
    return tuple(replace(m, rgba=CLOTH_RGBA) for m in models) if config.camouflage else models


def _unique_names(models: Sequence[ObjectModel]) -> tuple[str, ...]:
    """Names of the bodies: the objects' own, numbered from the second of a kind on."""
    names: list[str] = []
    for model in models:
        name, k = model.name, 2
        while name in names:
            name, k = f"{model.name}_{k}", k + 1
        names.append(name)
    return tuple(names)
