"""One process that computes the networks of all workers of this machine: `--runtime shared`.

A GPU serves many processes best from one: their images are computed together, in batches, and the networks
are in its memory once. Images and heads go through shared memory, a word about each through a socket. Where
there is no GPU the server computes one image after the other as a worker would, with the same bits.
"""

from __future__ import annotations

import math
import os
import secrets
import threading
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from multiprocessing import AuthenticationError, get_context
from multiprocessing.connection import Connection, Listener, wait
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpgrasp.detectors.runtimes.compiled import fingerprint, made_ready, of_weights, read_in_torch
from mpgrasp.detectors.runtimes.runtime import has_cuda
from mpgrasp.exceptions import ConfigError, MpgraspError
from mpgrasp.processes import born_deaf, die_with_parent, ignore_interrupts

ADDRESS = "MPGRASP_INFERENCE_SERVER"
"""Environment variable that tells workers of the server: its address and its key."""
START_LIMIT = 60.0
"""Time in which the server must be there [s]; networks are loaded when they are asked for."""
HEADS = 4

_context = get_context("spawn")


@contextmanager
def inference_server() -> Iterator[None]:
    """Let processes that are started inside of the block share a server.

    Raises:
        ConfigError: it does not start.
    """
    ours, theirs = _context.Pipe()
    key = secrets.token_hex(16)
    process = _context.Process(target=_serve, args=(theirs, key), daemon=True)
    with born_deaf():
        process.start()
    theirs.close()
    try:
        address = ours.recv() if ours.poll(START_LIMIT) else None
    except EOFError:
        address = None
    if address is None:
        process.kill()
        raise ConfigError("the inference server does not start", got="--runtime shared", allowed="auto")
    before = os.environ.get(ADDRESS)
    os.environ[ADDRESS] = f"{key}@{address}"
    try:
        yield
    finally:
        os.environ.pop(ADDRESS)
        if before is not None:
            os.environ[ADDRESS] = before
        ours.close()  # by which the server ends, and frees what it shared
        process.join(START_LIMIT)
        process.kill()


def write(memory: SharedMemory, start: int, values: NDArray[np.float32]) -> None:
    """Copy numbers into a memory, from its `start`-th number on."""
    assert memory.buf is not None
    memory.buf[4 * start : 4 * start + values.nbytes] = values.tobytes()


def read(memory: SharedMemory, start: int, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return a copy of numbers in a memory, from its `start`-th number on."""
    assert memory.buf is not None
    return np.frombuffer(memory.buf, np.float32, math.prod(shape), 4 * start).reshape(shape).copy()


@dataclass(eq=False)
class _Client:
    """A process that shares a network."""

    connection: Connection
    network: _Shared
    memory: SharedMemory

    def image(self) -> NDArray[np.float32]:
        """The input (channels, H, W) that it wrote."""
        return read(self.memory, 0, self.network.shape)

    def answer(self, heads: NDArray[np.float32]) -> None:
        """Let it read its heads (4, H, W)."""
        write(self.memory, math.prod(self.network.shape), heads)
        with suppress(OSError):  # it has ended, which the next look at it tells
            self.connection.send("done")

    def close(self) -> None:
        """Free what it shared."""
        self.connection.close()
        self.memory.close()
        self.memory.unlink()


class _Shared:
    """A network that clients share."""

    def __init__(self, name: str, weights: Path) -> None:
        if has_cuda():
            from mpgrasp.detectors.runtimes.torch_runtime import TorchBatch

            read = read_in_torch(name, weights)
            self._batch: TorchBatch | None = TorchBatch(read)
            self.facts = of_weights(read, self._batch, weights)
        else:
            self._batch, self.facts = None, made_ready(name, weights)
        image = self.facts.input
        self.shape = image.channels, image.size, image.size
        self.bytes = 4 * (image.channels + HEADS) * image.size**2

    def heads(self, images: Sequence[NDArray[np.float32]]) -> list[NDArray[np.float32]]:
        """Heads (4, H, W) of each image (channels, H, W)."""
        if self._batch is not None:
            return self._batch.all_of(images)
        return [self.facts.runtime(image) for image in images]

    def hello(self, memory: str) -> dict[str, Any]:
        """What a client must know."""
        image, runtime = asdict(self.facts.input), self.facts.runtime
        return {
            "input": image,
            "width_px": self.facts.width_px,
            "calibration": None if self.facts.calibration is None else asdict(self.facts.calibration),
            "runtime": runtime.name,
            "device": runtime.device,
            "cached": runtime.cached,
            "memory": memory,
        }


class _Server:
    """Networks and clients of the server's process."""

    def __init__(self) -> None:
        self._networks: dict[tuple[str, str | None], _Shared] = {}
        self._clients: dict[Connection, _Client] = {}

    def run(self, parent: Connection, listener: Listener) -> None:
        """Compute what is asked for until the parent's pipe ends."""
        fresh, doorbell = _context.Pipe(duplex=False)
        guests: SimpleQueue[Connection] = SimpleQueue()
        threading.Thread(target=_accept, args=(listener, guests, doorbell), daemon=True).start()
        try:
            while True:
                ready = wait([parent, fresh, *self._clients])
                if parent in ready:
                    return
                if fresh in ready:
                    fresh.recv()
                    self._welcome(guests.get())
                self._answer([client for one, client in [*self._clients.items()] if one in ready])
        finally:
            for client in self._clients.values():
                client.close()

    def _welcome(self, connection: Connection) -> None:
        """Get a network ready for a process, and tell it where their memory is."""
        try:
            name, weights = connection.recv()
            key = name, fingerprint(Path(weights))
            if key not in self._networks:
                self._networks[key] = _Shared(name, Path(weights))
            network = self._networks[key]
            memory = SharedMemory(create=True, size=network.bytes)
            self._clients[connection] = _Client(connection, network, memory)
            connection.send(network.hello(memory.name))
        except MpgraspError as error:
            connection.send(error)
            connection.close()
        except (EOFError, OSError):
            self._forget(connection)

    def _answer(self, asking: Sequence[_Client]) -> None:
        """Compute the images of those who ask, all of one network together."""
        waiting: dict[_Shared, list[_Client]] = defaultdict(list)
        for client in asking:
            try:
                client.connection.recv()
                waiting[client.network].append(client)
            except (EOFError, OSError):
                self._forget(client.connection)
        for network, clients in waiting.items():
            heads = network.heads([client.image() for client in clients])
            for client, found in zip(clients, heads, strict=True):
                client.answer(found)

    def _forget(self, connection: Connection) -> None:
        client = self._clients.pop(connection, None)
        if client is None:
            connection.close()
        else:
            client.close()


def _accept(listener: Listener, guests: SimpleQueue[Connection], doorbell: Connection) -> None:
    """Let processes in that know the key, for ever."""
    while True:
        try:
            guests.put(listener.accept())
        except (AuthenticationError, EOFError, OSError):
            continue
        doorbell.send(None)


def _serve(parent: Connection, key: str) -> None:
    """Be the server, in a process of its own."""
    ignore_interrupts()
    threading.Thread(target=die_with_parent, daemon=True).start()
    with Listener(authkey=bytes.fromhex(key)) as listener:
        parent.send(listener.address)
        _Server().run(parent, listener)
