# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Training of a network that gives a class to each pixel, within a budget of time, and its figures.

Images are arrays, (n, h, w, c) of uint8 (or of floats, for range images); masks are (n, h, w) uint8 with the index of
the class, 255 where a pixel does not count. The same code runs on CPUs and on CUDA.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from pickle import UnpicklingError
from time import monotonic
from typing import Any, TypedDict, Unpack

import networks
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

import fieldtruth as ft

Augment = Callable[[Tensor, Tensor, torch.Generator], tuple[Tensor, Tensor]]
"""Changes a batch: images (n, c, h, w) float32, of uint8 in 0 to 1, and masks (n, h, w) int64; of the same device."""
Log = Callable[[str], None]

IGNORED = 255
CHECKPOINT_S = 60.0
LINE_S = 30.0
WARM_UP = 0.1  # share of the budget in which the learning rate rises
WATCHES = 10  # times that ``watch`` is called in a training
WEIGHT_DECAY = 1e-4
CHUNK = 64  # masks that are counted at once
SLOW = 0.1  # learning rate of an encoder with weights of others, as a share: a high one would undo what it knows
WEIGHT_POWER = 0.5  # a class that is a hundredth as frequent weighs ten times as much


@dataclass(frozen=True)
class Settings:
    """Classes of a network, the size of the images that it was trained on, and its kind.

    Attributes:
        classes: names; the mask has their index.
        height: of an image [pixel].
        width: of an image [pixel].
        channels: 3 of an image.
        network: a name in ``networks.NETWORKS``.
        seed: of the first weights, of the order of samples and of their augmentation.
    """

    classes: tuple[str, ...]
    height: int
    width: int
    channels: int = 3
    network: str = "unet"
    seed: int = 0


class Plan(TypedDict, total=False):
    """Options of ``fit``; the values after the colon are the defaults.

    minutes: budget of time [min]: 50. The learning rate follows a one-cycle over it, whatever the speed.
    steps: number of steps in place of the budget of time, for the same weights on every machine: None.
    learning_rate: the highest: 3e-3.
    batch: images in a step: 16.
    data: text that tells other frames from these, so that a training does not go on with others: "".
    augment: changes each batch; see ``Augment``: None.
    watch: figures by name of the network in the middle of the training, for TensorBoard: None.
    """

    minutes: float
    steps: int | None
    learning_rate: float
    batch: int
    data: str
    augment: Augment | None
    watch: Callable[[nn.Module], Mapping[str, float]] | None


def device() -> torch.device:
    """Return the device that networks are trained on: CUDA, if there is one."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def has_bfloat16(where: torch.device) -> bool:
    """Return whether a device multiplies bfloat16 faster than float32: CUDA, and CPUs with instructions for it."""
    known: dict[str, Any] = getattr(torch.cpu, "get_capabilities", dict)()
    return where.type == "cuda" or bool(known.get("avx512_bf16") or known.get("amx_bf16"))


def make_network(settings: Settings) -> nn.Module:
    """Return a network whose first weights follow from the seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        return networks.make(settings.network, settings.channels, len(settings.classes))


def class_weights(masks: NDArray[np.uint8], classes: int) -> NDArray[np.float32]:
    """Return weights of the loss by class: rare classes weigh more. Their mean over pixels is 1; 0 without a pixel."""
    parts = (masks[first : first + CHUNK].reshape(-1) for first in range(0, len(masks), CHUNK))  # it makes 8 bytes of 1
    counts = np.sum([np.bincount(part, minlength=256)[:classes] for part in parts], axis=0)
    shares = counts / max(1, counts.sum())
    weights = np.where(counts, np.maximum(shares, 1e-6) ** -WEIGHT_POWER, 0.0)
    return np.asarray(weights / max(1e-9, (weights * shares).sum()), np.float32)


def fit(
    network: nn.Module,
    settings: Settings,
    images: NDArray[Any],
    masks: NDArray[np.uint8],
    *,
    out: Path | None = None,
    log: Log = print,
    **plan: Unpack[Plan],
) -> None:
    """Train a network in place.

    Args:
        network: as ``make_network`` or ``load`` returns it.
        settings: its settings.
        images: (n, h, w, c); may be mapped into memory.
        masks: (n, h, w) uint8.
        out: folder in which ``checkpoint.pt`` is written once a minute, and ``network.pt`` at the end. A training whose
            checkpoint is there goes on from it.
        log: receives a line now and then.
        plan: options; see ``Plan``.

    Raises:
        ft.ConfigurationError: no images, or a checkpoint of other settings.
    """
    if not len(images) or len(images) != len(masks):
        raise ft.ConfigurationError(f"images and masks must be equally many, at least 1: {len(images)}, {len(masks)}")
    weights = torch.from_numpy(class_weights(masks, len(settings.classes))).to(device())
    training = _Training(network, settings, plan, out)
    network.train()
    try:
        while not training.is_done():
            loss = training.step(images, masks, weights)
            training.report(loss, log)
    finally:
        training.close()
    network.eval()
    if out is not None:
        training.write_checkpoint()
        save(out / "network.pt", network, settings)


class _Training:
    """State of a training, all of which a checkpoint has."""

    def __init__(self, network: nn.Module, settings: Settings, plan: Plan, out: Path | None) -> None:
        self.network, self.settings, self.device = network, settings, device()
        self.minutes, self.steps = plan.get("minutes", 50.0), plan.get("steps")
        self.rate, self.batch = plan.get("learning_rate", 3e-3), plan.get("batch", 16)
        self.augment, self.watch, self.data = plan.get("augment"), plan.get("watch"), plan.get("data", "")
        self.path = None if out is None else out / "checkpoint.pt"
        network.to(self.device, memory_format=torch.channels_last)
        self.optimiser = torch.optim.AdamW(_groups(network), lr=self.rate, weight_decay=WEIGHT_DECAY)
        self.done, self.before_s, self.losses = 0, 0.0, list[float]()
        self._resume()
        self.first = self.done
        self.start_s = self.saved_s = self.line_s = monotonic()
        self.watched = int(self.progress() * WATCHES)
        self.board = None if out is None else _board(out / "tensorboard", self.done)

    def key(self) -> dict[str, Any]:
        """Return what must be equal for a training to go on from a checkpoint."""
        plan = {"minutes": self.minutes, "steps": self.steps, "learning_rate": self.rate, "batch": self.batch}
        return _values(self.settings) | plan | {"data": self.data}

    def progress(self) -> float:
        """Return the share of the budget that is used, in 0 to 1."""
        if self.steps is not None:
            return min(1.0, self.done / max(1, self.steps))
        return min(1.0, (self.before_s + monotonic() - self.start_s) / max(1e-9, 60.0 * self.minutes))

    def is_done(self) -> bool:
        """Return whether the budget is used up."""
        return self.progress() >= 1.0

    def step(self, images: NDArray[Any], masks: NDArray[np.uint8], weights: Tensor) -> float:
        """Do a step on a batch that follows from the seed and the number of the step alone; return the loss."""
        rng = np.random.default_rng((self.settings.seed, self.done))
        chosen = np.sort(self._next(len(images)))
        x, y = _batch(images[chosen], self.device), torch.from_numpy(masks[chosen]).to(self.device, torch.int64)
        if self.augment is not None:
            generator = torch.Generator(self.device).manual_seed(int(rng.integers(2**62)))
            x, y = self.augment(x, y, generator)
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate * group["share"] * one_cycle(self.progress())
        with torch.autocast(self.device.type, torch.bfloat16, enabled=has_bfloat16(self.device)):
            logits = self.network(x.contiguous(memory_format=torch.channels_last))
        loss = nn.functional.cross_entropy(logits.float(), y, weights, ignore_index=IGNORED)
        self.optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimiser.step()
        self.done += 1
        return float(loss.detach())

    def _next(self, count: int) -> NDArray[np.int64]:
        """Return the images of this step; each of ``count`` images occurs once in an epoch, in an order of its own."""
        places = self.done * self.batch + np.arange(self.batch)
        orders = {
            epoch: np.random.default_rng((self.settings.seed, epoch, count)).permutation(count)
            for epoch in np.unique(places // count).tolist()
        }
        return np.array([orders[place // count][place % count] for place in places.tolist()])

    def report(self, loss: float, log: Log) -> None:
        """Print a line, write scalars and a checkpoint, each when its time has come."""
        self.losses.append(loss)
        now = monotonic()
        if now - self.line_s >= LINE_S:
            mean, self.losses, self.line_s = float(np.nanmean(self.losses)), [], now
            speed = (self.done - self.first) / (now - self.start_s)
            log(f"step {self.done}, {speed:.2f} steps/s, loss {mean:.3f}, {self._left_s(speed):.0f} s left")
            self._write({"loss": mean, "learning rate": self.rate * one_cycle(self.progress())})
        if self.watch is not None and int(self.progress() * WATCHES) > self.watched:
            self.watched = int(self.progress() * WATCHES)
            figures = self.watch(self.network)
            self.network.train()
            log(f"step {self.done}: " + ", ".join(f"{name} {value:.3f}" for name, value in figures.items()))
            self._write(figures)
        if monotonic() - self.saved_s >= CHECKPOINT_S:
            self.write_checkpoint()

    def close(self) -> None:
        """Write the last scalars."""
        if self.board is not None:
            self.board.close()

    def _left_s(self, speed: float) -> float:
        if self.steps is not None:
            return (self.steps - self.done) / speed
        return 60.0 * self.minutes * (1.0 - self.progress())

    def _write(self, figures: Mapping[str, float]) -> None:
        if self.board is not None:
            for name, value in figures.items():
                self.board.add_scalar(name, value, self.done)

    def write_checkpoint(self) -> None:
        """Write the state to a file that is whole at any time."""
        self.saved_s = monotonic()
        if self.path is not None:
            state = {"network": self.network.state_dict(), "optimiser": self.optimiser.state_dict()}
            used_s = self.before_s + self.saved_s - self.start_s
            _write_atomically(self.path, state | {"key": self.key(), "done": self.done, "seconds": used_s})

    def _resume(self) -> None:
        if self.path is None or not self.path.exists():
            return
        state = torch.load(self.path, map_location=self.device, weights_only=True)
        for name, value in self.key().items():
            if state["key"].get(name) != value:
                was = f"has a training with {name} {state['key'].get(name)}, not {value}"
                was = "has a training on other frames" if name == "data" else was
                raise ft.ConfigurationError(f"{self.path.parent} {was}; choose another folder, or remove this one")
        self.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.done, self.before_s = state["done"], state["seconds"]


def one_cycle(progress: float) -> float:
    """Return the learning rate as a share of the highest: it rises linearly, then falls as a cosine to 0."""
    if progress < WARM_UP:
        return 0.05 + 0.95 * progress / WARM_UP
    return 0.5 + 0.5 * math.cos(math.pi * (progress - WARM_UP) / (1.0 - WARM_UP))


def predict(network: nn.Module, images: NDArray[Any], batch: int = 16) -> NDArray[np.float32]:
    """Return probabilities, (n, classes, h, w), of images (n, h, w, c); of photographs the mean of both mirrors."""
    where = device()
    network.to(where).eval()
    found = []
    with torch.no_grad():
        for first in range(0, len(images), batch):
            x = _batch(images[first : first + batch], where)
            shares = torch.softmax(network(x).float(), dim=1)
            if x.shape[1] == 3:
                shares = (shares + torch.softmax(network(x.flip(3)).float(), dim=1).flip(3)) / 2.0
            found.append(shares.cpu().numpy())
    return np.concatenate(found)


def confusion(truth: NDArray[np.uint8], predicted: NDArray[Any], classes: int) -> NDArray[np.int64]:
    """Count pixels by true class (row) and predicted class (column), (classes, classes); those of 255 do not count."""
    counted = truth < classes
    pairs = truth[counted].astype(np.int64) * classes + predicted[counted].astype(np.int64)
    return np.bincount(pairs, minlength=classes * classes).reshape(classes, classes)


def iou(matrix: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the intersection over union of each class; NaN for a class without a true pixel."""
    hits = np.diag(matrix).astype(np.float64)
    true, union = matrix.sum(axis=1), matrix.sum(axis=0) + matrix.sum(axis=1) - hits
    return np.where(true > 0, hits / np.maximum(1, union), np.nan)


def save(path: Path, network: nn.Module, settings: Settings) -> None:
    """Write a network and its settings to a file, which is whole at any time."""
    _write_atomically(Path(path), {"settings": _values(settings), "network": network.state_dict()})


def load(path: Path) -> tuple[nn.Module, Settings]:
    """Read a network, ready to predict, and its settings.

    Raises:
        ft.ConfigurationError: not a file that ``save`` wrote.
    """
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        values = state["settings"]
        settings = Settings(**values | {"classes": tuple(values["classes"])})
        network = make_network(settings)
        network.load_state_dict(state["network"])
    except OSError as error:
        raise ft.ConfigurationError(f"{path} cannot be read: {error.strerror or error}") from error
    except (EOFError, RuntimeError, LookupError, TypeError, ValueError, UnpicklingError) as error:
        raise ft.ConfigurationError(f"{path} is not a trained network, or not one of this version") from error
    return network.to(device()).eval(), settings


def _values(settings: Settings) -> dict[str, Any]:
    return asdict(settings) | {"classes": list(settings.classes)}


def _groups(network: nn.Module) -> list[dict[str, Any]]:
    """Return the weights by the share of the learning rate that they have."""
    encoder = list(network.encoder.parameters()) if hasattr(network, "encoder") else []
    known = {id(each) for each in encoder}
    rest = [each for each in network.parameters() if id(each) not in known]
    return [{"params": each, "share": share} for each, share in ((rest, 1.0), (encoder, SLOW)) if each]


def _batch(images: NDArray[Any], where: torch.device) -> Tensor:
    """Return (n, c, h, w) float32, of uint8 in 0 to 1."""
    x = torch.from_numpy(np.array(images)).to(where).permute(0, 3, 1, 2)
    return x.float() / 255.0 if images.dtype == np.uint8 else x.float()


def _write_atomically(path: Path, state: Mapping[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    torch.save(dict(state), part)
    part.replace(path)


def _board(folder: Path, done: int) -> Any:
    """Return a writer of TensorBoard's scalars, or None where it is not installed."""
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder), purge_step=done)
