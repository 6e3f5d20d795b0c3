"""The program ppm-vk: where it is, what it can, and a run of it."""

import collections
import json
import os
import queue
import shutil
import subprocess
import threading

import bpy

from .settings import preferences

# Seconds that a program that was told to stop has for writing its picture.
_GRACE = 20


class ProgramError(Exception):
    """Why there is no picture, in one line."""


def find():
    """The program's path."""
    of_addon = preferences()
    chosen = bpy.path.abspath(of_addon.program) if of_addon and of_addon.program else ""
    if chosen and not os.path.isfile(chosen):
        raise ProgramError(f"There is no program {chosen}: correct its path in the add-on's preferences")
    path = chosen or shutil.which("ppm-vk")
    if not path:
        raise ProgramError(
            "The program ppm-vk is not on the search path: install it, or set its path in the add-on's preferences"
        )
    return path


_help = {}


def has_flag(path, flag):
    """Whether the program lists a flag in its help."""
    key = (path, os.path.getmtime(path))
    if key not in _help:
        _help[key] = start([path, "--help"]).communicate()[0]
    return f"{flag} " in _help[key] or f"{flag}\n" in _help[key]


def start(command, folder=None):
    """Starts a program whose output is read."""
    hidden = {"creationflags": subprocess.CREATE_NO_WINDOW} if os.name == "nt" else {}
    try:
        return subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            **hidden,
        )
    except OSError as error:
        raise ProgramError(f"{command[0]} does not start: {error.strerror or error}") from error


class Run:
    """A run of the program, and its events."""

    def __init__(self, path, arguments, folder):
        self._process = start([path, *arguments, "--progress=json"], folder)
        self._events = queue.Queue()
        self._last_lines = collections.deque(maxlen=20)
        self._readers = [threading.Thread(target=reader, daemon=True) for reader in (self._read_events, self._read_lines)]
        for reader in self._readers:
            reader.start()

    def _read_events(self):
        for line in self._process.stdout:
            try:
                self._events.put(json.loads(line))
            except ValueError:
                self._last_lines.append(line)
        self._events.put({"event": "end"})

    def _read_lines(self):
        self._last_lines.extend(self._process.stderr)

    def next_event(self, seconds):
        """The next event; None if there is none for so long."""
        try:
            return self._events.get(timeout=seconds)
        except queue.Empty:
            return None

    def stop(self):
        """Tells it to write its picture and to end."""
        self._process.terminate()

    def kill(self):
        self._process.kill()

    def wait(self):
        """Its exit code, once its events have ended."""
        try:
            code = self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
            code = self._process.wait()
        for reader in self._readers:
            reader.join(_GRACE)
        self._process.stdout.close()
        self._process.stderr.close()
        return code

    def last_line(self):
        """The last line that it printed: where it fails, why."""
        lines = [line.strip() for line in self._last_lines if line.strip()]
        # A wrong argument's message comes before advice on --help.
        errors = [line for line in lines if line.startswith("error:")]
        return (errors or lines or ["it printed nothing"])[-1].removeprefix("error: ")
