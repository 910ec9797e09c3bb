// Meshes and how a graphics card draws them: one program for all, colours by number, z up, metres.

/** Colours that meshes refer to by their place here: those of the style sheet by name, the others as they are. */
const PAINTS = [
  ...[
    "own",
    "ground",
    "verge",
    "walk",
    "shoulder",
    "bike",
    "road",
    "mark",
    "unmarked",
    "thing",
    "wall",
    "leaf",
    "tyre",
    "pane",
  ],
  ...[
    "#e0483d",
    "#f0be00",
    "#4a90ff",
    "#2fa84f",
    "#f08a24",
    "#a86be0",
    "#ff2a1a",
    "#ffb020",
    "#fff6d8",
    "#24292f",
    "#f4f6f8",
  ],
  ...["#1fae54", "#d9a98a"],
];
const paint = name => PAINTS.indexOf(name);
const SUN = [0.36, -0.48, 0.8];
const LAMPS = { none: 0, brake: 1, left: 2, right: 3, head: 4, back: 5 };

const VERTICES = `#version 300 es
precision highp float;
in vec3 place;
in vec4 normal;
in vec4 info; // paint, lamp, layer
uniform mat4 view;
uniform mat4 model;
uniform vec3 paints[${PAINTS.length}];
uniform float lamps[6];
uniform vec3 eye;
uniform vec3 sky;
uniform vec2 haze;
uniform vec3 shadow;
out vec4 colour;
void main() {
  vec3 local = shadow.z > 0.0 ? vec3(place.xy - shadow.xy * place.z, 0.04) : place;
  vec4 world = model * vec4(local, 1.0);
  gl_Position = view * world;
  gl_Position.z -= info.z * 8e-6 * gl_Position.w; // what lies upon something is drawn above it
  vec3 own = paints[int(info.x)];
  float light = 0.82 + 0.23 * dot(normalize(mat3(model) * normal.xyz), vec3(${SUN.join()}));
  if (info.y > 0.0) {
    float lit = lamps[int(info.y)];
    own *= mix(0.45, 1.0, lit);
    light = mix(light, 1.0, lit);
  }
  float far = smoothstep(haze.x, haze.y, distance(world.xyz, eye));
  colour = shadow.z > 0.0 ? vec4(0.0, 0.0, 0.0, 0.32 * (1.0 - far)) : vec4(mix(own * light, sky, far), 1.0);
}`;
const FRAGMENTS = `#version 300 es
precision mediump float;
in vec4 colour;
out vec4 seen;
void main() { seen = colour; }`;

/** Red, green and blue from 0 to 1 of "#rrggbb" or "rgb(…)". */
function rgb(text) {
  if (text.startsWith("#")) return [1, 3, 5].map(at => parseInt(text.slice(at, at + 2), 16) / 255);
  return text
    .match(/[\d.]+/g)
    .slice(0, 3)
    .map(value => value / 255);
}

/** Points with normals, colours, lamps and layers, and triangles between them. */
class Mesh {
  constructor() {
    Object.assign(this, { points: [], info: [], faces: [], size: 0 });
  }

  /** Add a point; its normal is of any length. */
  point(x, y, z, [nx, ny, nz], own, lamp = 0, layer = 0) {
    this.points.push(x, y, z);
    this.info.push(nx, ny, nz, own, lamp, layer);
    return this.size++;
  }

  /** A flat face with any number of corners that does not bend inwards. */
  face(corners, own, lamp = 0, layer = 0) {
    const [a, b, c] = corners;
    const [u, v] = [b, c].map(each => each.map((value, i) => value - a[i]));
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const long = Math.hypot(...normal) || 1,
      unit = normal.map(value => value / long);
    const first = this.size;
    for (const [x, y, z] of corners) this.point(x, y, z, unit, own, lamp, layer);
    for (let i = 2; i < corners.length; i++) this.faces.push(first, first + i - 1, first + i);
  }

  /** A body between two rectangles [back, front, half width, height]; `sides` have another colour than its top. */
  frustum([x0, x1, w, z], [u0, u1, v, t], own, { sides = own, lamp = 0, y = 0 } = {}) {
    const low = [
        [x1, y + w, z],
        [x0, y + w, z],
        [x0, y - w, z],
        [x1, y - w, z],
      ],
      high = [
        [u1, y + v, t],
        [u0, y + v, t],
        [u0, y - v, t],
        [u1, y - v, t],
      ];
    this.face(high, own, lamp);
    this.face([...low].reverse(), own, lamp);
    for (let i = 0; i < 4; i++) {
      const j = (i + 1) % 4;
      this.face([low[i], low[j], high[j], high[i]], sides, lamp);
    }
  }

  /** An upright prism or, with another radius at its top, a cone. */
  column(x, y, radius, low, high, own, { top = radius, corners = 8 } = {}) {
    const ring = (r, z) =>
      Array.from({ length: corners }, (_, i) => {
        const angle = (2 * Math.PI * i) / corners;
        return [x + r * Math.cos(angle), y + r * Math.sin(angle), z];
      });
    const [below, above] = [ring(radius, low), ring(top, high)];
    for (let i = 0; i < corners; i++) {
      const j = (i + 1) % corners;
      this.face([below[i], below[j], above[j], above[i]], own);
    }
    if (top > 0) this.face(above, own);
  }

  /** Points as the graphics card reads them: 12 bytes of place, 4 of normal, 4 of colour, lamp and layer. */
  packed() {
    const bytes = new ArrayBuffer(this.size * 20),
      view = new DataView(bytes);
    for (let i = 0, at = 0; i < this.size; i++, at += 20) {
      for (let k = 0; k < 3; k++) view.setFloat32(at + 4 * k, this.points[3 * i + k], true);
      for (let k = 0; k < 3; k++) view.setInt8(at + 12 + k, Math.round(this.info[6 * i + k] * 127));
      for (let k = 0; k < 3; k++) view.setUint8(at + 16 + k, this.info[6 * i + 3 + k]);
    }
    return bytes;
  }
}

/** The program, its uniforms, and meshes on the graphics card. */
class Painter {
  constructor(canvas) {
    const options = { alpha: false, stencil: true, powerPreference: "high-performance" };
    const quick = { ...options, antialias: true, failIfMajorPerformanceCaveat: true };
    // smooth edges cost a software renderer four times the pixels
    this.gl = canvas.getContext("webgl2", quick) ?? canvas.getContext("webgl2", { ...options, antialias: false });
    if (!this.gl) return;
    const { gl } = this,
      program = gl.createProgram();
    for (const [kind, source] of [
      [gl.VERTEX_SHADER, VERTICES],
      [gl.FRAGMENT_SHADER, FRAGMENTS],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["place", "normal", "info"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
    gl.linkProgram(program);
    gl.useProgram(program);
    this.at = {};
    for (const name of ["view", "model", "paints", "lamps", "eye", "sky", "haze", "shadow"])
      this.at[name] = gl.getUniformLocation(program, name);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Send a mesh to the graphics card. */
  keep(mesh) {
    const { gl } = this,
      array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, mesh.packed(), gl.STATIC_DRAW);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 20, 0);
    gl.vertexAttribPointer(1, 4, gl.BYTE, true, 20, 12);
    gl.vertexAttribPointer(2, 4, gl.UNSIGNED_BYTE, false, 20, 16);
    for (const i of [0, 1, 2]) gl.enableVertexAttribArray(i);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint32Array.from(mesh.faces), gl.STATIC_DRAW);
    return { array, from: 0, count: mesh.faces.length };
  }

  draw({ array, from, count }) {
    if (!count) return;
    this.gl.bindVertexArray(array);
    this.gl.drawElements(this.gl.TRIANGLES, count, this.gl.UNSIGNED_INT, 4 * from);
  }

  place(matrix) {
    this.gl.uniformMatrix4fv(this.at.model, false, matrix);
  }

  /** Let lamps be lit, from 0 to 1, in the order of LAMPS. */
  light(lit) {
    this.gl.uniform1fv(this.at.lamps, lit);
  }
}

// matrices, column by column ---------------------------------------------------------------------

const times = (a, b) =>
  Float32Array.from({ length: 16 }, (_, i) => {
    const [column, row] = [4 * (i >> 2), i & 3];
    return a[row] * b[column] + a[row + 4] * b[column + 1] + a[row + 8] * b[column + 2] + a[row + 12] * b[column + 3];
  });

const shifted = (x, y, z) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];

/** A turn about one axis (0 ahead, 1 to the left, 2 upwards), rad. */
function turned(axis, angle) {
  const found = shifted(0, 0, 0),
    [u, v] = [(axis + 1) % 3, (axis + 2) % 3],
    [c, s] = [Math.cos(angle), Math.sin(angle)];
  found[5 * u] = found[5 * v] = c;
  found[4 * u + v] = s;
  found[4 * v + u] = -s;
  return found;
}

const placed = ({ x, y, z, h, pitch, roll }) => {
  const upright = times(shifted(x, y, z), turned(2, h));
  return pitch || roll ? times(times(upright, turned(1, pitch)), turned(0, roll)) : upright;
};

/** From world to picture for an eye with a heading and a tilt upwards (rad). */
function seenFrom({ x, y, z, h, tilt }, wide, high, field, near, far) {
  const [c, s, d, u] = [Math.cos(h), Math.sin(h), Math.cos(tilt), Math.sin(tilt)];
  const ahead = [c * d, s * d, u],
    right = [s, -c, 0],
    up = [-c * u, -s * u, d];
  const at = axis => -(axis[0] * x + axis[1] * y + axis[2] * z);
  const turn = [0, 1, 2].flatMap(i => [right[i], up[i], -ahead[i], 0]);
  const camera = [...turn, at(right), at(up), -at(ahead), 1];
  const f = 1 / Math.tan(field / 2);
  const lens = [
    (f * high) / wide,
    0,
    0,
    0,
    0,
    f,
    0,
    0,
    0,
    0,
    (near + far) / (near - far),
    -1,
    0,
    0,
    (2 * near * far) / (near - far),
    0,
  ];
  return times(lens, camera);
}
