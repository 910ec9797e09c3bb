"""FMUs for tests, compiled from one source in C: FMI 2 and 3, scalar variables and OSMP."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import Any

SOURCE = r"""
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <stdbool.h>

typedef struct {
  double v, gap, set, headway, x, y, h; int fail; bool engaged;
  unsigned char *view, out[2][512]; size_t view_size, size; int init_size, parity; double time;
  void (*log2)(void *, const char *, int, const char *, const char *, ...);
  void (*log3)(void *, int, const char *, const char *);
} Model;

static void say(Model *m, const char *text) {
  if (m->log2) m->log2(0, "ego", 3, "error", "%s", text);
  if (m->log3) m->log3(0, 3, "error", text);
}

/* the first field of a message with a number: its content and length, a varint in *length with content 0, or -1 */
static const unsigned char *find(const unsigned char *p, size_t n, int number, long *length) {
  const unsigned char *end = p + n;
  *length = -1;
  while (p < end) {
    uint64_t key = 0, value = 0; int shift;
    for (shift = 0; p < end; shift += 7) { key |= (uint64_t)(*p & 127) << shift; if (!(*p++ & 128)) break; }
    if ((key & 7) == 0 || (key & 7) == 2)
      for (shift = 0; p < end; shift += 7) { value |= (uint64_t)(*p & 127) << shift; if (!(*p++ & 128)) break; }
    size_t size = (key & 7) == 2 ? value : (key & 7) == 1 ? 8 : (key & 7) == 5 ? 4 : 0;
    if (key >> 3 == (uint64_t)number) { *length = (key & 7) == 0 ? (long)value : (long)size; return p; }
    p += size;
  }
  return 0;
}

static unsigned char *number_field(unsigned char *p, int number, double value) {
  *p++ = number << 3 | 1; memcpy(p, &value, 8); return p + 8;
}

static unsigned char *varint(unsigned char *p, uint64_t value) {
  while (value > 127) { *p++ = (value & 127) | 128; value >>= 7; }
  *p++ = value; return p;
}

static unsigned char *message(unsigned char *p, int number, const unsigned char *content, size_t n) {
  *p++ = number << 3 | 2; p = varint(p, n); memcpy(p, content, n); return p + n;
}

/* drives the host of the view, the first moving object, by 19 m/s along x */
static int traffic(Model *m, double time, double dt) {
  long n, lanes;
  const unsigned char *view = m->view, *truth, *object, *base, *position;
  if (!view || !(truth = find(view, m->view_size, 7, &n))) { say(m, "no ground truth"); return 3; }
  /* the roads come first, in a ground truth of their own, unless the parameter has had them */
  find(truth, n, 10, &lanes);
  if ((lanes < 0) == (m->init_size == 0)) { say(m, "roads are missing, or there twice"); return 3; }
  if (lanes >= 0) {
    const unsigned char *rest = truth + n;
    truth = find(rest, m->view + m->view_size - rest, 7, &n);
  }
  object = find(truth, n, 5, &n); base = find(object, n, 2, &n); position = find(base, n, 2, &n);
  double x, y, yaw = 0.0; long size;
  memcpy(&x, find(position, n, 1, &size), 8); memcpy(&y, find(position, n, 2, &size), 8);
  x += 19.0 * dt;
  unsigned char a[128], b[256], c[300], *end, *out = m->out[m->parity ^= 1];
  end = number_field(number_field(a, 1, x), 2, y); end = message(b, 2, a, end - a);
  unsigned char d[16]; unsigned char *e = number_field(d, 3, yaw); end = message(end, 3, d, e - d);
  e = number_field(number_field(a, 1, 19.0), 2, 0.0); end = message(end, 4, a, e - a);
  end = message(c, 2, b, end - b);
  if (m->fail == 4) { memset(out, 255, 20); m->size = 20; return 0; }
  m->size = message(out, 3, c, end - c) - out;
  return 0;
}

/* asks for a trajectory: at 18 m/s from the start at x = 100, from a second before to a second after */
static void request(Model *m, double time) {
  unsigned char points[256], *p = points, *out = m->out[m->parity ^= 1];
  for (int i = -1; i <= 1; i += 2) {
    unsigned char t[16], v[32], o[16], s[96], *e = s, *q = t;
    double at = time + i; long seconds = floor(at);
    *q++ = 1 << 3; q = varint(q, (uint64_t)seconds); *q++ = 2 << 3; q = varint(q, (uint64_t)((at - seconds) * 1e9));
    e = message(e, 1, t, q - t);
    q = number_field(number_field(v, 1, 100.0 + 18.0 * at), 2, m->y); e = message(e, 2, v, q - v);
    q = number_field(o, 3, 0.0); e = message(e, 3, o, q - o);
    p = message(p, 1, s, e - s);
  }
  m->size = message(out, 5, points, p - points) - out;
}

static int step(Model *m, double time, double dt) {
  if (fabs(time - m->time) > 1e-9) { say(m, "a step does not follow the one before"); return 3; }
  m->time = time + dt;
  if (m->fail == 1 && time > 0.5) return 2;
  if (m->fail == 2 && time > 0.5) { say(m, "the plant has no\nsolution"); return 3; }
  if (m->fail == 5) abort();
  if (MOTION) { request(m, time + dt); return 0; }
  if (m->view || m->init_size) return traffic(m, time, dt);
  m->x += m->v * dt;
  return 0;
}

static double get(Model *m, unsigned r) {
  double a = 0.5 * (m->set - m->v);
  if (m->gap < m->headway * m->v) a = -3.0;
  switch (r) {
    case 0: return m->v; case 1: return m->gap; case 2: return m->set; case 3: return m->headway;
    case 4: return m->fail; case 10: return m->fail == 3 ? NAN : a; case 11: return a < 0 ? -a / 8.0 : 0.0;
    case 12: return a > 0 ? a / 8.0 : 0.0; case 13: return m->engaged && m->gap < m->headway * m->v;
    case 14: return m->x; case 15: return m->y; case 16: return m->h; case 17: return m->fail == 3 ? INFINITY : m->v;
    case 46: case 43: return (int32_t)(uint32_t)(uintptr_t)m->out[m->parity];
    case 47: case 44: return (int32_t)(uint32_t)((uintptr_t)m->out[m->parity] >> 32); case 48: case 45: return (double)m->size;
  }
  return 0.0;
}

static void set(Model *m, unsigned r, double value) {
  static uint32_t half;
  switch (r) {
    case 0: m->v = value; break; case 1: m->gap = value; break; case 2: m->set = value; break; case 3: m->headway = value; break;
    case 4: m->fail = (int)value; break; case 5: m->engaged = value != 0.0; break;
    case 14: m->x = value; break; case 15: m->y = value; break; case 16: m->h = value; break;
    case 40: case 50: half = (uint32_t)(int32_t)value; break;
    case 41: m->view = (unsigned char *)((uintptr_t)(uint32_t)(int32_t)value << 32 | half); break;
    case 42: m->view_size = (size_t)value; break; case 52: m->init_size = (int)value; break;
  }
}

typedef unsigned vr;
#define EACH for (size_t i = 0; i < n; i++)
#if FMI == 2
typedef struct { void *log, *allocate, *release, *finished, *environment; } Callbacks;
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const Callbacks *c, int v, int l) {
  if (strcmp(g, "the token")) return 0;
  Model *m = calloc(1, sizeof(Model)); m->log2 = c->log; m->headway = 1.0; m->gap = 1e9; m->engaged = true; return m;
}
void fmi2FreeInstance(void *m) { free(m); }
int fmi2SetupExperiment(Model *m, int d, double t, double start, int s, double stop) { m->time = start; return 0; }
int fmi2DoStep(Model *m, double t, double dt, int n) { return step(m, t, dt); }
int fmi2GetReal(Model *m, const vr *r, size_t n, double *v) { EACH v[i] = get(m, r[i]); return 0; }
int fmi2GetInteger(Model *m, const vr *r, size_t n, int *v) { EACH v[i] = (int)get(m, r[i]); return 0; }
int fmi2GetBoolean(Model *m, const vr *r, size_t n, int *v) { EACH v[i] = get(m, r[i]) != 0.0; return 0; }
int fmi2SetReal(Model *m, const vr *r, size_t n, const double *v) { EACH set(m, r[i], v[i]); return 0; }
int fmi2SetInteger(Model *m, const vr *r, size_t n, const int *v) { EACH set(m, r[i], v[i]); return 0; }
int fmi2SetBoolean(Model *m, const vr *r, size_t n, const int *v) { EACH set(m, r[i], v[i]); return 0; }
#else
void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *p, bool v, bool l, bool e, bool r, const vr *q,
                                  size_t k, void *c, void *log, void *u) {
  if (strcmp(g, "the token")) return 0;
  Model *m = calloc(1, sizeof(Model)); m->log3 = log; m->headway = 1.0; m->gap = 1e9; m->engaged = true; return m;
}
void fmi3FreeInstance(Model *m) { free(m->view); free(m); }
int fmi3EnterInitializationMode(Model *m, bool d, double t, double start, bool s, double stop) { m->time = start; return 0; }
int fmi3DoStep(Model *m, double t, double dt, bool n, bool *e, bool *end, bool *r, double *last) {
  *e = *r = false; *end = m->fail == 6; *last = t + dt; return step(m, t, dt);
}
int fmi3GetFloat64(Model *m, const vr *r, size_t n, double *v, size_t k) { EACH v[i] = get(m, r[i]); return 0; }
int fmi3GetInt32(Model *m, const vr *r, size_t n, int *v, size_t k) { EACH v[i] = (int)get(m, r[i]); return 0; }
int fmi3GetBoolean(Model *m, const vr *r, size_t n, bool *v, size_t k) { EACH v[i] = get(m, r[i]) != 0.0; return 0; }
int fmi3SetFloat64(Model *m, const vr *r, size_t n, const double *v, size_t k) { EACH set(m, r[i], v[i]); return 0; }
int fmi3SetInt32(Model *m, const vr *r, size_t n, const int *v, size_t k) { EACH set(m, r[i], v[i]); return 0; }
int fmi3SetBoolean(Model *m, const vr *r, size_t n, const bool *v, size_t k) { EACH set(m, r[i], v[i]); return 0; }
int fmi3GetBinary(Model *m, const vr *r, size_t n, size_t *s, const void **v, size_t k) {
  s[0] = m->size; v[0] = m->out[m->parity]; return 0;
}
int fmi3SetBinary(Model *m, const vr *r, size_t n, const size_t *s, const void **v, size_t k) {
  if (r[0] == 50) { m->init_size = (int)s[0]; return 0; }
  m->view = realloc(m->view, s[0]); m->view_size = s[0]; memcpy(m->view, v[0], s[0]); return 0;
}
#endif
#define STUB(name) int name(void) { return 0; }
STUBS
"""

_SCALARS = {
    "v_ego": (0, "input", "Real"),
    "gap": (1, "input", "Real"),
    "v_set": (2, "input", "Real"),
    "on": (5, "input", "Boolean"),
    "headway": (3, "parameter", "Real"),
    "fail": (4, "parameter", "Integer"),
    "a_demand": (10, "output", "Real"),
    "brake_pedal": (11, "output", "Real"),
    "gas_pedal": (12, "output", "Real"),
    "engaged": (13, "output", "Boolean"),
    "x_start": (14, "parameter", "Real"),
    "y_start": (15, "parameter", "Real"),
    "x": (14, "output", "Real"),
    "y": (15, "output", "Real"),
    "h": (16, "output", "Real"),
    "speed": (17, "output", "Real"),
}
"""Variables: value reference, causality, type of FMI 2"""
_BINARIES = {
    "OSMPSensorViewIn": (40, "input"),
    "OSMPTrafficUpdateOut": (43, "output"),
    "OSMPMotionRequestOut": (46, "output"),
    "OSMPGroundTruthInit": (50, "parameter"),
    "OSMPSensorDataIn": (60, "input"),
}
_OF_FMI_3 = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}
COMPILER = which("gcc") or which("cc")


@cache
def library(version: int, motion: bool) -> bytes:
    """The compiled model."""
    slave = getattr(import_module(f"fmpy.fmi{version}"), f"FMU{version}Slave")
    defined = SOURCE.partition("typedef unsigned vr")[2].partition("#else")[
        0 if version == 2 else 2
    ]
    names = (name for name in dir(slave) if name.startswith(f"fmi{version}"))
    stubs = "".join(f"STUB({name})\n" for name in names if f"{name}(" not in defined)
    options = ["-shared", "-fPIC", "-O1", "-w", f"-DFMI={version}", f"-DMOTION={int(motion)}"]
    with TemporaryDirectory(prefix="xosc-test-fmu-") as folder:
        source, target = Path(folder, "model.c"), Path(folder, "model.so")
        source.write_text(SOURCE.replace("STUBS", stubs))
        subprocess.run([str(COMPILER), *options, str(source), "-o", str(target), "-lm"], check=True)
        return target.read_bytes()


def description(
    version: int, variables: dict[str, tuple[int, str, str]], kind: str = "CoSimulation"
) -> str:
    """The modelDescription.xml."""
    starts = {"input", "parameter"}
    lines = []
    for name, (reference, causality, type_) in variables.items():
        variability = (
            "fixed" if causality == "parameter" else "continuous" if type_ == "Real" else "discrete"
        )
        start = (
            ' start="0"'
            if causality in starts and type_ != "Boolean"
            else ' start="false"'
            if causality in starts
            else ""
        )
        common = (
            f'name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{variability}"'
        )
        if version == 2:
            lines.append(f"<ScalarVariable {common}><{type_}{start}/></ScalarVariable>")
        elif type_ == "Binary":
            inner = '<Start value="00"/>' if causality in starts else ""
            lines.append(f"<Binary {common}>{inner}</Binary>")
        else:
            lines.append(f"<{_OF_FMI_3[type_]} {common}{start}/>")
    if version == 3:
        lines.append(
            '<Float64 name="time" valueReference="99" causality="independent" '
            'variability="continuous"/>'
        )
    token = 'guid="the token"' if version == 2 else 'instantiationToken="the token"'
    outputs = [
        (number, each[0])
        for number, each in enumerate(variables.values(), 1)
        if each[1] == "output"
    ]
    if version == 2:
        structure = (
            "<Outputs>"
            + "".join(f'<Unknown index="{number}"/>' for number, _ in outputs)
            + "</Outputs>"
        )
    else:
        structure = "".join(f'<Output valueReference="{reference}"/>' for _, reference in outputs)
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="{version}.0" '
        f'modelName="ego" {token}>'
        f'<{kind} modelIdentifier="ego"/><ModelVariables>{"".join(lines)}</ModelVariables>'
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def fmu(
    folder: Path,
    version: int = 2,
    osmp: Iterable[str] = (),
    mapping: str = "",
    *,
    name: str = "ego",
    **changes: Any,
) -> Path:
    """Write an FMU with its mapping file: scalar variables, or binary ones of
    OSMP where some are named.

    Args:
        changes: `kind` of the interface, `platform` of the binary, and `text`, which replaces the
            description.
    """
    import fmpy

    variables: dict[str, tuple[int, str, str]] = {} if osmp else dict(_SCALARS)
    if osmp:
        variables["fail"] = _SCALARS["fail"]
    for prefix in osmp:
        reference, causality = _BINARIES[prefix]
        if version == 2:
            roles = ("base.lo", "base.hi", "size")
            variables |= {
                f"{prefix}.{role}": (reference + n, causality, "Integer")
                for n, role in enumerate(roles)
            }
        else:
            variables[prefix] = (reference, causality, "Binary")
    if version == 3:  # value references are unique there
        variables = {
            each: value for each, value in variables.items() if each not in ("x_start", "y_start")
        }
    platform = changes.get("platform", fmpy.platform if version == 2 else fmpy.platform_tuple)
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        text = changes.get("text") or description(
            version, variables, changes.get("kind", "CoSimulation")
        )
        archive.writestr("modelDescription.xml", text)
        archive.writestr(
            f"binaries/{platform}/ego{fmpy.sharedLibraryExtension}",
            library(version, "OSMPMotionRequestOut" in osmp),
        )
    if mapping:
        path.with_suffix(".toml").write_text(mapping, encoding="utf-8")
    return path
