"""Can a policy be learned that searches? One that imitates robust MVP, as stable-baselines3 saves it.

    python benchmarks/learn_search.py --out policy.zip
    python -m mpgrasp.bench find_stick --controller sb3:policy.zip,straight_down,mvp_robust ...

The teacher, MVP's rule with this project's robust grid, plays `mpgrasp/Search-v0`, in scenes that no
benchmark run uses. From the second round on the learner steers, ever more often, and the teacher says what it
would have done (Ross et al., "A Reduction of Imitation Learning and Structured Prediction to No-Regret Online
Learning", 2011), so that the learner also sees where its own errors lead. PPO's policy is fitted to the
actions; to go on by reinforcement, `PPO.load("policy.zip", env=...).learn(...)`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from study import Parser, run_command, track

from mpgrasp.command_line import COUNT, SEED
from mpgrasp.controllers.config import MVP_ROBUST
from mpgrasp.env import GraspEnv
from mpgrasp.exceptions import ConfigError

TEACHER = replace(MVP_ROBUST, choice="pool", v_z=0.01)
"""Settings of MP-PC's rule that make it the teacher: no attenuation, and it comes down slowly."""
KEPT = 0.25
"""Share of the views that are learned from: neighbours look alike."""
EPOCHS, BATCH, RATE = 6, 64, 3e-4

Rows = dict[str, list[NDArray[Any]]]


def watch(env: GraspEnv, model: Any, share: float, rng: np.random.Generator, rows: Rows) -> bool:
    """Play an episode in which the learner steers in a share of the ticks; True if it succeeded.

    Args:
        env: with `observations="images"`.
        model: of stable-baselines3.
        share: of the ticks in which the learner's action is taken.
        rng: draws them, and the views that are kept.
        rows: what is seen and what the teacher would do, to which this adds.
    """
    observed, info = env.reset()
    over = False
    while not over:
        action = info["mppc_action"]
        if rng.random() < KEPT:
            for name, value in (*observed.items(), ("action", action)):
                rows.setdefault(name, []).append(value)
        if rng.random() < share:
            action = model.predict(observed, deterministic=True)[0]
        observed, _, over, _, info = env.step(action)
    return bool(info["is_success"])


def fit(model: Any, rows: Rows, rng: np.random.Generator) -> float:
    """Fit the policy's mean action to the teacher's; return the last epoch's mean squared error."""
    import torch

    policy, n = model.policy, len(rows["action"])
    data = {name: np.stack(values) for name, values in rows.items()}
    optimiser = torch.optim.Adam(policy.parameters(), RATE)
    policy.set_training_mode(True)
    for _ in track(range(EPOCHS), "epochs", EPOCHS):
        losses = []
        for part in np.array_split(rng.permutation(n), max(1, n // BATCH)):
            batch = {name: torch.as_tensor(values[part]) for name, values in data.items()}
            wanted = batch.pop("action")
            mean = policy.get_distribution(batch).distribution.mean
            loss = torch.mean((mean - wanted) ** 2)
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            losses.append(float(loss.detach()))
    policy.set_training_mode(False)
    return float(np.mean(losses))


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--rounds", metavar="N", type=COUNT, default=4, help="default: 4")
    add("--episodes", metavar="N", type=COUNT, default=40, help="of each round (default: 40)")
    add("--seed", metavar="S", type=SEED, default=0, help="default: 0")
    add("--out", metavar="FILE", type=Path, default=Path("policy.zip"), help="default: policy.zip")
    options = parser.parse_args(command)
    if options.out.suffix != ".zip":
        raise ConfigError("stable-baselines3 saves policies as zip", got=str(options.out), allowed="*.zip")
    from stable_baselines3 import PPO

    env = GraspEnv("find_stick", controller=TEACHER, observations="images")
    model = PPO("MultiInputPolicy", env, seed=options.seed, device="cpu")
    env.reset(seed=options.seed)
    rng, rows = np.random.default_rng(options.seed), Rows()
    for k in range(options.rounds):
        share = k / options.rounds
        won = [
            watch(env, model, share, rng, rows)
            for _ in track(range(options.episodes), f"round {k + 1}", options.episodes)
        ]
        error = fit(model, rows, rng)
        print(
            f"round {k + 1}: {np.mean(won):.0%} succeeded, the learner steered {share:.0%} of the ticks;"
            f" {len(rows['action'])} views, mean squared error {error:.3f}"
        )
        model.save(options.out)
    env.close()
    print(f"Policy: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
