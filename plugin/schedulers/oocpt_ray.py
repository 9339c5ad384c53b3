#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A frame on a cluster of Ray: blocks of its samples are tasks, merged as they come, until the error is small enough.

    oocpt_ray.py --scene SCENE --folder FOLDER --frame 7 --samples 1024 --blocks 16 --target-error 1e-4 \\
        --out shot.%04d.exr -- FLAGS

Needs `ray`; workers need what `oocpt_farm.py` does, this folder, and FOLDER, under the same names.

- Ray schedules: it runs a block again if its worker or node dies, or if a signal ended it before it had its samples.
- With a target error blocks are handed out in their order, and the error is asked where samples double: after 1, 2, 4,
  ... blocks. So the samples of the picture do not depend on the number of workers. What is under way then is given up.
- The film of the frame is a file of FOLDER. The next run goes on from there, also if this program was killed.
"""

from __future__ import annotations

import argparse
import fcntl
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
if str(HERE) not in sys.path:
    sys.path.insert(0, str(HERE))

import oocpt_farm  # noqa: E402  beside this file

# Samples below which an error says too little to stop at, as in a render.
FEWEST_SAMPLES = 16


class FrameError(Exception):
    """A frame that cannot be finished, in words."""


@dataclass(frozen=True)
class RayFrame:
    """What is rendered: the options of `oocpt_farm.py part`, and when it is enough."""

    scene: str
    folder: str
    frame: int
    samples: int
    out: str
    blocks: int = 16
    # relMSE: the upper end of its interval; 0 renders all samples.
    target_error: float = 0.0
    camera: str = ""
    settings: str = ""
    render_pass: str = ""
    caches: str = ""
    width: int = 960
    # Any other settings, `KEY=VALUE`.
    values: tuple[str, ...] = ()
    # More flags of usdrecord.
    flags: tuple[str, ...] = ()

    def words(self, block: int) -> list[str]:
        """The command of a block."""
        scene, folder = Path(self.scene).absolute(), Path(self.folder).absolute()
        caches = str(Path(self.caches).absolute()) if self.caches else ""
        line = [f"--scene={scene}", f"--folder={folder}", f"--frame={self.frame}", f"--samples={self.samples}"]
        line += [f"--blocks={self.blocks}", f"--block={block}", f"--camera={self.camera}", f"--width={self.width}"]
        line += [f"--settings={self.settings}", f"--render-pass={self.render_pass}", f"--caches={caches}"]
        return ["part", *line, *(f"--set={one}" for one in self.values), "--", *self.flags]

    def span(self, block: int) -> tuple[int, int]:
        return oocpt_farm.span((block, block), self.samples, self.blocks)

    def has_samples(self, block: int) -> bool:
        begin, end = self.span(block)
        return begin < end

    def parts(self) -> Path:
        return oocpt_farm.folder_of(argparse.Namespace(folder=self.folder, frame=self.frame))

    def part(self, block: int) -> Path:
        return self.parts() / oocpt_farm.part_name(self.span(block))


@dataclass(frozen=True)
class RayWorkers:
    """What a block takes of the cluster."""

    # `auto` is the cluster of this machine, empty the one of RAY_ADDRESS or, without, one of this machine's own.
    address: str = ""
    cpus: float = 1.0
    gpus: float = 0.0
    # How often a block is run again.
    retries: int = 8
    # Blocks at a time where an error is to be met; 0: as many as the cluster has room for.
    at_once: int = 0


@dataclass(frozen=True)
class FrameResult:
    """The picture, its samples, and the interval of its relMSE where that is known."""

    picture: Path
    samples: int
    error: tuple[float, float] | None


@dataclass
class BlockPlan:
    """Which blocks are handed out and merged. Without a target all are at once; with one the first `open` may merge,
    and later ones are handed out ahead of the decision."""

    blocks: int
    has_target: bool
    merged: set[int] = field(default_factory=set)
    given: set[int] = field(default_factory=set)
    here: set[int] = field(default_factory=set)
    open: int = 0

    def __post_init__(self) -> None:
        self.open = 1 if self.has_target else self.blocks
        while self.open < self.blocks and not set(range(self.open + 1, self.blocks + 1)).isdisjoint(self.merged):
            self.widen()

    def widen(self) -> None:
        self.open = min(2 * self.open, self.blocks)

    def next(self) -> int | None:
        """A block to hand out."""
        taken = self.merged | self.given | self.here
        block = next((block for block in range(1, self.blocks + 1) if block not in taken), None)
        if block is not None:
            self.given.add(block)
        return block

    def came(self, block: int) -> None:
        self.given.remove(block)
        self.here.add(block)

    def take(self) -> list[int]:
        """The blocks to merge now."""
        taken = sorted(block for block in self.here if block <= self.open)
        self.here.difference_update(taken)
        self.merged.update(taken)
        return taken

    def is_whole(self) -> bool:
        """Whether all blocks that may merge have, so that the error is known."""
        return self.merged.issuperset(range(1, self.open + 1))


def is_enough(errors: Iterable[dict], target: float) -> bool:
    """Whether the error at a power of two of samples is small enough, as a render decides it."""
    known = [(one["samples"], one["estimate"]) for one in errors if one["estimate"]]
    powers = [(samples, estimate) for samples, estimate in known if samples & (samples - 1) == 0]
    return any(samples >= FEWEST_SAMPLES and estimate["high"] <= target for samples, estimate in powers)


def run_part(folder: str, words: list[str]) -> None:
    """A task of Ray: runs the program of a task, which ends with its worker."""
    import subprocess
    import sys

    if folder not in sys.path:
        sys.path.insert(0, folder)
    import oocpt_farm

    done = subprocess.run(
        [sys.executable, f"{folder}/oocpt_farm.py", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        text=True, errors="replace", preexec_fn=oocpt_farm.ends_with_parent(), check=False,
    )  # fmt: skip
    said = (done.stdout.strip().splitlines() or [""])[-1].removeprefix("openjd_fail: ")
    if done.returncode == oocpt_farm.TRY_AGAIN or done.returncode < 0:
        raise InterruptedError(said)
    if done.returncode:
        raise RuntimeError(said or f"exit status {done.returncode}")


class FrameFilm:
    """The film of a frame, to which parts are merged."""

    def __init__(self, frame: RayFrame) -> None:
        self.frame, self.path = frame, frame.parts() / "merged.film"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # Freed by the system however this process ends.
        self.lock = self.path.with_suffix(".lock").open("w")
        try:
            fcntl.lockf(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise FrameError(f"{self.path}: another program merges this frame") from error

    def facts(self) -> dict | None:
        found = [facts for _, facts in oocpt_farm.facts_of([self.path] if self.path.exists() else [])]
        if self.path.exists() and not found:
            raise FrameError(f"{self.path} is no film, or is damaged: remove it")
        return found[0] if found else None

    def blocks(self) -> set[int]:
        """The blocks that it has."""
        facts = self.facts()
        have = oocpt_farm.samples_of(facts) if facts else []
        blocks = filter(self.frame.has_samples, range(1, self.frame.blocks + 1))
        spans = {block: self.frame.span(block) for block in blocks}
        inside = {block for block, (a, b) in spans.items() if any(begin <= a and b <= end for begin, end in have)}
        if sum(end - begin for begin, end in have) != sum(spans[block][1] - spans[block][0] for block in inside):
            told = ", ".join("{}..{}".format(*one) for one in have)
            raise FrameError(f"{self.path} has samples {told}, which are no blocks of this frame: remove it")
        return inside

    def merge(self, blocks: list[int]) -> None:
        parts = [self.frame.part(block) for block in blocks if self.frame.has_samples(block)]
        if not parts:
            return
        films = [str(film) for film in (self.path, *parts) if film != self.path or film.exists()]
        line = ["oocpt", "film", "merge", *films, "--out", str(self.path)]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        if done.returncode:
            raise FrameError(done.stderr.strip())
        for part in parts:
            part.unlink(missing_ok=True)

    def remove_merged(self, blocks: set[int]) -> None:
        """Parts that are in the film: this program was killed before it removed them."""
        for block in blocks:
            self.frame.part(block).unlink(missing_ok=True)

    def is_enough(self) -> bool:
        facts = self.facts()
        return facts is not None and is_enough(facts["errors"], self.frame.target_error)

    def samples(self, facts: dict) -> int:
        return sum(end - begin for begin, end in oocpt_farm.samples_of(facts))

    def told(self) -> str:
        facts = self.facts()
        text = f"{self.samples(facts) if facts else 0} of {self.frame.samples} samples"
        if facts and facts["errors"] and (last := facts["errors"][-1])["estimate"]:
            text += ", relMSE {relMse:.1e} ({low:.1e} to {high:.1e})".format(**last["estimate"])
            text += f" at {last['samples']}"
        return text

    def result(self) -> FrameResult:
        out = oocpt_farm.picture_file(self.frame.out, self.frame.frame)
        if oocpt_farm.make_picture([self.path], out):
            raise FrameError(f"the picture {out} cannot be made")
        facts = self.facts() or {}
        last = facts["errors"][-1]["estimate"] if facts["errors"] else None
        return FrameResult(out, self.samples(facts), (last["low"], last["high"]) if last else None)


def room(ray: object, workers: RayWorkers) -> int:
    """How many blocks the cluster takes at a time."""
    have = ray.cluster_resources()
    kinds = [(have.get("CPU", 0.0), workers.cpus), (have.get("GPU", 0.0), workers.gpus)]
    return max(1, int(min((there / asked for there, asked in kinds if asked > 0), default=1)))


def render(frame: RayFrame, workers: RayWorkers = RayWorkers(), tell: Callable[[str], None] = print) -> FrameResult:
    """Renders a frame, and returns when its picture is written. `tell` gets a line whenever something was merged.

    Raises FrameError, with what is done kept in the folder, and what `ray.init` does.
    """
    import ray

    film = FrameFilm(frame)
    plan = BlockPlan(frame.blocks, frame.target_error > 0, film.blocks())
    film.remove_merged(plan.merged)
    has_started = not ray.is_initialized()
    if has_started:
        ray.init(address=workers.address or None, log_to_driver=False)
    try:
        ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])
        options = {"num_cpus": workers.cpus, "num_gpus": workers.gpus, "max_retries": workers.retries}
        task = ray.remote(**options, retry_exceptions=[InterruptedError])(run_part)
        most = (workers.at_once or room(ray, workers)) if plan.has_target else frame.blocks
        _hand_out(ray, lambda block: task.remote(str(HERE), frame.words(block)), (plan, film, most), tell)
    finally:
        if has_started:
            ray.shutdown()
    return film.result()


def _hand_out(
    ray: object, start: Callable[[int], object], state: tuple[BlockPlan, FrameFilm, int], tell: Callable[[str], None]
) -> None:
    """Hands out blocks, at most so many at a time, until the film has what it needs."""
    plan, film, most = state
    under_way: dict[object, int] = {}
    try:
        while True:
            if taken := plan.take():
                film.merge(taken)
                tell(film.told())
            if plan.is_whole():
                if plan.open == plan.blocks or film.is_enough():
                    return
                plan.widen()
                continue
            while len(under_way) < most and (block := plan.next()) is not None:
                under_way[start(block)] = block
            _wait(ray, under_way, plan)
    finally:
        for one in under_way:
            ray.cancel(one, force=True)


def _wait(ray: object, under_way: dict[object, int], plan: BlockPlan) -> None:
    """Waits for a block, and takes all that are there by then."""
    ray.wait(list(under_way), num_returns=1)
    for one in ray.wait(list(under_way), num_returns=len(under_way), timeout=0)[0]:
        block = under_way.pop(one)
        try:
            ray.get(one)
        except ray.exceptions.RayError as error:
            cause = getattr(error, "cause", None) or error
            raise FrameError(f"block {block} cannot be rendered: {cause}") from error
        plan.came(block)


def error(text: str) -> float:
    """A relMSE."""
    value = float(text)
    if not 0.0 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"{text} is no number from 0 to 1e9")
    return value


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter,
        parents=[oocpt_farm.frame_options(), oocpt_farm.scene_options()],
    )  # fmt: skip
    options.add_argument("--out", required=True, help="EXR file; %%04d stands for the frame")
    options.add_argument("--target-error", type=error, default=0.0, metavar="RELMSE", help="0 renders all samples")
    options.add_argument("--address", default="", help="of the cluster, such as auto; without, RAY_ADDRESS or a new one")
    options.add_argument("--cpus", type=float, default=1.0, help="of a block")
    options.add_argument("--gpus", type=float, default=0.0, help="of a block")
    options.add_argument("--retries", type=oocpt_farm.number(0, 10**6), default=8, help="of a block")
    options.add_argument("--at-once", type=oocpt_farm.number(0, 10**6), default=0, help="blocks; 0: as many as fit")
    return options


def main() -> int:
    given = vars(parser().parse_args())
    workers = RayWorkers(**{name: given.pop(name) for name in ("address", "cpus", "gpus", "retries", "at_once")})
    frame = RayFrame(values=tuple(given.pop("set")), flags=tuple(given.pop("flags")), **given)
    try:
        result = render(frame, workers, lambda text: print(text, flush=True))
    except ImportError as error:
        sys.exit(f"{error}: pip install ray")
    except FrameError as error:
        sys.exit(f"frame {frame.frame}: {error}")
    print(f"{result.picture}: {result.samples} samples")
    return 0


if __name__ == "__main__":
    sys.exit(main())
