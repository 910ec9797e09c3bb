"""FMUs for co-simulation, of FMI 2 and 3: description, variables, steps, and binary variables as of
OSMP. Needs the extra `fmi`.

An FMU is native code: it is unpacked into the cache folder and loaded into this process, and
`--untrusted` refuses it.

Sources: FMI 2.0.4 and 3.0.1 (fmi-standard.org); ASAM OSI Sensor Model Packaging 1.5 for binary
variables.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, UsageError, reason
from schemas.common.packages import optional
from schemas.common.policy import current
from schemas.common.storage import Stamp, cache_folder, read_bytes, stamp
from schemas.common.terminal.text import one_line

Value = float | int | bool | str | bytes

_LONGEST_SAID = 200
"""Characters of a log message of an FMU that an error shows"""
_DISCARD, _FATAL = 2, 4
"""Statuses of FMI: the first beyond a warning, and the one after which nothing of the instance may
be called"""
_WHOLE = (
    "Integer",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Enumeration",
)


class Description(NamedTuple):
    """An FMU as it describes itself.

    Args:
        path: the file.
        content: its unpacked content.
        model: fmpy's model description.
        variables: fmpy's variables by name.
    """

    path: Path
    content: Path
    model: Any
    variables: Mapping[str, Any]

    @property
    def version(self) -> int:
        """Major version of FMI."""
        return int(self.model.fmiVersion.partition(".")[0])

    def has_binary(self, prefix: str) -> bool:
        """Whether it has a binary variable of that name; in FMI 2 the three integers that OSMP puts
        in its place."""
        if self.version == 2:
            return all(
                f"{prefix}.{role}" in self.variables for role in ("base.lo", "base.hi", "size")
            )
        return prefix in self.variables and self.variables[prefix].type == "Binary"


def describe_fmu(path: Path) -> Description:
    """Read and unpack an FMU; once in a process for each version of the file.

    Raises:
        MissingExtra: fmpy is not installed.
        UsageError: the policy in force loads no foreign code, or the cache folder can't be written.
        InvalidFile: this is no FMU.
        Unsupported: it is not for co-simulation, of another version of FMI, or has no binary for
            this machine.
    """
    current().admit_code(f"the FMU {path}")
    return _described(path, stamp(path))


@lru_cache(maxsize=8)
def _described(path: Path, version: Stamp) -> Description:
    fmpy, reader = optional("fmpy"), optional("fmpy.model_description")
    data = read_bytes(path)
    if not zipfile.is_zipfile(BytesIO(data)):
        raise InvalidFile(
            "this is no FMU: a zip archive with a modelDescription.xml is expected", path=path
        )
    content = _unpacked(path, data, fmpy)
    if not (content / "modelDescription.xml").is_file():
        raise InvalidFile("this is no FMU: the archive has no modelDescription.xml", path=path)
    try:
        model = reader.read_model_description(str(content))
    except Exception as error:  # it raises bare exceptions
        raise InvalidFile(
            f"the modelDescription.xml can't be read: {one_line(str(error))[:_LONGEST_SAID]}",
            path=path,
        ) from None
    if not model.fmiVersion.startswith(("2.", "3.")):
        raise Unsupported(
            f"this FMU is of FMI {model.fmiVersion}; 2 and 3 are supported", path=path
        )
    if model.coSimulation is None:
        raise Unsupported("this FMU is not for co-simulation", path=path)
    # FMI 2 and 3 name the folders of binaries differently, as linux64 and x86_64-linux.
    folder = fmpy.platform if model.fmiVersion.startswith("2.") else fmpy.platform_tuple
    if not (
        content
        / "binaries"
        / folder
        / f"{model.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
    ).is_file():
        there = sorted(
            folder.name for folder in (content / "binaries").glob("*") if folder.is_dir()
        )
        raise Unsupported(
            f"this FMU has no binary for {folder}; there are {', '.join(there) or 'none'}",
            path=path,
        )
    return Description(
        path, content, model, {variable.name: variable for variable in model.modelVariables}
    )


def _unpacked(path: Path, data: bytes, fmpy: Any) -> Path:
    """Folder of the cache with the content of an FMU; processes may do this at once."""
    # By content: a changed file of the same name is unpacked anew.
    target = cache_folder() / "fmu" / hashlib.blake2b(data, digest_size=20).hexdigest()
    if target.is_dir():
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        # Complete or not at all: another process must not see a part of it.
        scratch = tempfile.mkdtemp(dir=target.parent)
        try:
            fmpy.extract(BytesIO(data), scratch)
            os.replace(scratch, target)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    except OSError as error:
        if target.is_dir():  # another process was faster
            return target
        message = (
            f"the cache folder cannot be written ({error.strerror or error}); set XOSC_CACHE_DIR "
            "to another one"
        )
        raise UsageError(message, path=target.parent) from None
    except Exception as error:  # a damaged archive, or paths that lead out of it
        raise InvalidFile(
            f"the FMU can't be unpacked: {one_line(reason(error))}", path=path
        ) from None
    return target


class Instance:
    """An instance of an FMU in initialisation mode, and then in steps.

    Args:
        described: the FMU.

    Raises:
        ToolchainError: it can't be loaded or instantiated. So do all methods where the FMU answers
            with discard, error or fatal.
    """

    def __init__(self, described: Description) -> None:
        self._described, self._said, self._status, self._time = described, "", 0, 0.0
        self._buffers: dict[str, Any] = {}
        """inputs of OSMP, which have to stay where they are until the step is done"""
        module = optional(f"fmpy.fmi{described.version}")
        make = getattr(module, f"FMU{described.version}Slave")
        model, working = described.model, os.getcwd()
        arguments = {
            "guid": model.guid if described.version == 2 else model.instantiationToken,
            "modelIdentifier": model.coSimulation.modelIdentifier,
            "unzipDirectory": str(described.content),
            "instanceName": "ego",
        }
        try:
            self._fmu = make(**arguments)
            if described.version == 2:
                self._fmu.instantiate(callbacks=self._callbacks(module))
            else:
                self._fmu.instantiate(
                    logMessage=lambda environment, status, category, message: self._hear(message)
                )
        except Exception as error:  # it raises bare exceptions
            raise self._failed(one_line(reason(error))) from None
        finally:
            os.chdir(working)  # a library that can't be loaded leaves it elsewhere

    def begin(self, time: float) -> None:
        """Enter initialisation mode; time in s."""
        if self._described.version == 2:
            self._call("setupExperiment", startTime=time)
            self._call("enterInitializationMode")
        else:
            self._call("enterInitializationMode", startTime=time)

    def begun(self) -> None:
        """Leave initialisation mode."""
        self._call("exitInitializationMode")

    def step(self, time: float, length: float) -> None:
        """Do a step; time and length in s."""
        self._time = time
        ended = self._call("doStep", time, length)
        # FMI 3 answers `terminateSimulation` in second place.
        if ended is not None and ended[1]:
            raise self._failed("it asks to end the simulation")

    def close(self) -> None:
        """Free the instance and its library."""
        # FMI: after an error an instance may only be freed, after a fatal one not even that.
        if self._status < _DISCARD:
            with suppress(ToolchainError):
                self._call("terminate")
        if self._status < _FATAL:
            self._fmu.freeInstance()

    def get(self, name: str) -> Value:
        """Return the value of a scalar variable."""
        variable = self._described.variables[name]
        value = self._call(f"get{self._kind(variable)}", [variable.valueReference])[0]
        return bool(value) if variable.type == "Boolean" else value

    def set(self, name: str, value: Value) -> None:
        """Set the value of a scalar variable, rounded for whole numbers."""
        variable = self._described.variables[name]
        if variable.type in _WHOLE:
            value = round(float(value))
        elif variable.type == "Boolean":
            value = bool(value)
        self._call(f"set{self._kind(variable)}", [variable.valueReference], [value])

    def _kind(self, variable: Any) -> str:
        if variable.type == "Enumeration":
            return "Integer" if self._described.version == 2 else "Int64"
        return str(variable.type)

    def get_binary(self, prefix: str) -> bytes:
        """Return the content of a binary variable; empty where there is none."""
        if self._described.version == 3:
            return (
                self._call("getBinary", [self._described.variables[prefix].valueReference])[0]
                or b""
            )
        lo, hi, size = (
            int(self.get(f"{prefix}.{role}")) for role in ("base.lo", "base.hi", "size")
        )
        # OSMP passes an address in FMI 2 as two integers of 32 bits, which are signed.
        address = (hi & 0xFFFFFFFF) << 32 | lo & 0xFFFFFFFF
        if size < 0:
            raise self._failed(f"{prefix}.size is {size}")
        return ctypes.string_at(address, size) if address and size else b""

    def set_binary(self, prefix: str, data: bytes) -> None:
        """Set the content of a binary variable; it stays in memory until the next one."""
        if self._described.version == 3:
            self._call("setBinary", [self._described.variables[prefix].valueReference], [data])
            return
        self._buffers[prefix] = buffer = ctypes.create_string_buffer(data, len(data))
        address = ctypes.addressof(buffer)
        for role, value in (
            ("base.lo", address & 0xFFFFFFFF),
            ("base.hi", address >> 32),
            ("size", len(data)),
        ):
            self.set(f"{prefix}.{role}", ctypes.c_int32(value).value)

    def _callbacks(self, module: Any) -> Any:
        """Callbacks of FMI 2 with a logger that keeps the last message."""
        callbacks = module.fmi2CallbackFunctions()
        callbacks.logger = module.fmi2CallbackLoggerTYPE(
            lambda environment, name, status, category, text: self._hear(text)
        )
        callbacks.allocateMemory = module.defaultCallbacks.allocateMemory
        callbacks.freeMemory = module.defaultCallbacks.freeMemory
        with suppress(Exception):  # without it the values in messages are missing
            optional("fmpy.logging").addLoggerProxy(ctypes.byref(callbacks))
        return callbacks

    def _hear(self, message: bytes | None) -> None:
        self._said = (message or b"").decode(errors="replace")

    def _call(self, function: str, *arguments: Any, **named: Any) -> Any:
        """Call a function of fmpy's instance."""
        try:
            return getattr(self._fmu, function)(*arguments, **named)
        except optional("fmpy.fmi1").FMICallException as error:
            self._status = error.status
            status = ("ok", "warning", "discard", "error", "fatal", "pending")
            raise self._failed(
                f"{error.function} answers "
                f"{status[error.status] if 0 <= error.status < 6 else error.status}"
            ) from None

    def _failed(self, what: str) -> ToolchainError:
        said = f"; its log says {one_line(self._said)[:_LONGEST_SAID]!r}" if self._said else ""
        return ToolchainError(
            f"the FMU fails at {self._time:.2f} s: {what}{said}", path=self._described.path
        )
