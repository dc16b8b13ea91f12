"use strict";
/* Triangles and lines on a canvas: WebGL, or a plain 2D painter where there is none. Matrices are column-major. */

const M4 = {
  times(a, b) {
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) {
      out[c * 4 + r] = a[r] * b[c * 4] + a[4 + r] * b[c * 4 + 1] + a[8 + r] * b[c * 4 + 2] + a[12 + r] * b[c * 4 + 3];
    }
    return out;
  },
  slide(axis, way) { return [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, axis[0] * way, axis[1] * way, axis[2] * way, 1]; },
  turn(axis, angle) {
    const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), t = 1 - c;
    return [t * x * x + c, t * x * y + s * z, t * x * z - s * y, 0, t * x * y - s * z, t * y * y + c, t * y * z + s * x, 0,
      t * x * z + s * y, t * y * z - s * x, t * z * z + c, 0, 0, 0, 0, 1];
  },
  perspective(fov, aspect, near, far) {
    const f = 1 / Math.tan(fov / 2);
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
  },
  look(eye, target, up) {
    const z = unit(minus(eye, target)), x = unit(cross(up, z)), y = cross(z, x);
    return [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1];
  },
  point(m, p) {
    return [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
  },
};
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };
const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
/* Flattens onto the floor along the light, a little above it. */
const LIGHT = unit([0.45, -0.35, 1]);
const SHADOW = [1, 0, 0, 0, 0, 1, 0, 0, -LIGHT[0] / LIGHT[2], -LIGHT[1] / LIGHT[2], 0, 0, 0, 0, 0.004, 1];

function colour(text) {
  const probe = colour.probe || (colour.probe = document.createElement("canvas").getContext("2d", { willReadFrequently: true }));
  probe.clearRect(0, 0, 1, 1);
  probe.fillStyle = text;
  probe.fillRect(0, 0, 1, 1);
  return [...probe.getImageData(0, 0, 1, 1).data].slice(0, 3).map((v) => v / 255);
}

const VERTEX = `attribute vec3 point; attribute vec3 normal; uniform mat4 model, view; varying vec3 n; varying vec3 p;
void main() { vec4 w = model * vec4(point, 1.0); p = w.xyz; n = mat3(model) * normal; gl_Position = view * w; }`;
const FRAGMENT = `precision mediump float; varying vec3 n; varying vec3 p; uniform vec3 tint, light, eye; uniform float alpha, flatness;
void main() { vec3 m = normalize(n); vec3 v = normalize(eye - p); if (dot(m, v) < 0.0) m = -m;
  float sky = 0.5 + 0.5 * m.z; float sun = max(dot(m, light), 0.0);
  float shine = pow(max(dot(reflect(-light, m), v), 0.0), 24.0) * 0.18;
  vec3 lit = tint * (0.42 + 0.24 * sky + 0.5 * sun) + shine; gl_FragColor = vec4(mix(lit, tint, flatness), alpha); }`;
/* A line is a quad as wide as asked for in pixels: WebGL's own lines are one pixel wide. */
const LINE_VERTEX = `attribute vec3 point, other, tint; attribute float side; uniform mat4 view; uniform vec2 pixel; uniform float wide;
varying vec3 c;
void main() { c = tint; vec4 a = view * vec4(point, 1.0); vec4 b = view * vec4(other, 1.0);
  vec2 along = (b.xy / max(b.w, 0.01) - a.xy / max(a.w, 0.01)) / pixel; float n = length(along);
  vec2 across = n > 1e-4 ? vec2(-along.y, along.x) / n : vec2(0.0);
  gl_Position = a + vec4(across * side * wide * pixel * a.w, 0.0, 0.0); }`;
const LINE_FRAGMENT = `precision mediump float; varying vec3 c; uniform float alpha; void main() { gl_FragColor = vec4(c, alpha); }`;

/* Corners of the quads of all segments: point, other end, tint, and side times width of each, 10 numbers a corner. */
function lineQuads(points, tints, strip, widths) {
  const count = strip ? points.length / 3 - 1 : points.length / 6, out = new Float32Array(Math.max(count, 0) * 60);
  for (let s = 0; s < count; s++) {
    const i = strip ? s : 2 * s;
    [[i, i + 1, 1], [i, i + 1, -1], [i + 1, i, -1], [i + 1, i, -1], [i + 1, i, 1], [i, i + 1, -1]].forEach(([a, b, side], k) => {
      const at = s * 60 + k * 10;
      for (let d = 0; d < 3; d++) { out[at + d] = points[3 * a + d]; out[at + 3 + d] = points[3 * b + d]; out[at + 6 + d] = tints[3 * a + d]; }
      out[at + 9] = widths ? side * widths[a] : side;
    });
  }
  return out;
}

class GlRenderer {
  static create(canvas) {
    const gl = canvas.getContext("webgl", { alpha: false, antialias: true, stencil: true, preserveDrawingBuffer: true });
    return gl ? new GlRenderer(canvas, gl) : null;
  }
  constructor(canvas, gl) {
    this.canvas = canvas;
    this.gl = gl;
    this.solid = this.program(VERTEX, FRAGMENT, ["point", "normal"], ["model", "view", "tint", "light", "eye", "alpha", "flatness"]);
    this.lines = this.program(LINE_VERTEX, LINE_FRAGMENT, ["point", "other", "tint", "side"], ["view", "alpha", "pixel", "wide"]);
  }
  program(vertex, fragment, attributes, uniforms) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    attributes.forEach((name, k) => gl.bindAttribLocation(program, k, name));
    gl.linkProgram(program);
    return { program, ...Object.fromEntries(uniforms.map((name) => [name, gl.getUniformLocation(program, name)])) };
  }
  mesh(points, normals, triangles) {
    const gl = this.gl, buffers = [points, normals].map((data) => this.fill(gl.createBuffer(), data));
    const index = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    return { buffers, index, count: triangles.length };
  }
  fill(buffer, data) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.DYNAMIC_DRAW);
    return buffer;
  }
  attribute(index, buffer) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 0, 0);
  }
  begin(view, eye, background) {
    const gl = this.gl;
    this.view = new Float32Array(view);
    this.eye = eye;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...background, 1);
    gl.clearStencil(0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }
  drawMesh(mesh, model, tint, alpha = 1, flatness = 0) {
    const gl = this.gl, u = this.solid;
    gl.useProgram(u.program);
    gl.uniformMatrix4fv(u.model, false, model);
    gl.uniformMatrix4fv(u.view, false, this.view);
    gl.uniform3fv(u.tint, tint);
    gl.uniform3fv(u.light, LIGHT);
    gl.uniform3fv(u.eye, this.eye);
    gl.uniform1f(u.alpha, alpha);
    gl.uniform1f(u.flatness, flatness);
    this.attribute(0, mesh.buffers[0]);
    this.attribute(1, mesh.buffers[1]);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.index);
    gl.depthMask(alpha === 1);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_SHORT, 0);
    gl.depthMask(true);
  }
  /* Flat shadows on the floor; the stencil keeps overlaps from getting darker. */
  drawShadows(items, tint, alpha) {
    const gl = this.gl;
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    for (const [mesh, model] of items) this.drawMesh(mesh, M4.times(SHADOW, model), tint, alpha, 1);
    gl.disable(gl.STENCIL_TEST);
  }
  /* Lines to draw again and again. points and tints: 3 numbers a corner; strip: one path, else pairs; widths: a factor a corner. */
  path(points, tints, strip, widths) {
    return { buffer: this.fill(this.gl.createBuffer(), lineQuads(points, tints, strip, widths)), count: strip ? points.length / 3 - 1 : points.length / 6 };
  }
  /* The first `count` segments of a path, `wide` pixels wide. */
  drawPath(path, { count = path.count, wide = 2, alpha = 1, onTop = false } = {}) {
    const gl = this.gl;
    if (count < 1) return;
    gl.useProgram(this.lines.program);
    gl.uniformMatrix4fv(this.lines.view, false, this.view);
    gl.uniform1f(this.lines.alpha, alpha);
    gl.uniform1f(this.lines.wide, wide * (window.devicePixelRatio || 1) / 2);
    gl.uniform2f(this.lines.pixel, 2 / this.canvas.width, 2 / this.canvas.height);
    gl.bindBuffer(gl.ARRAY_BUFFER, path.buffer);
    [[0, 3, 0], [1, 3, 12], [2, 3, 24], [3, 1, 36]].forEach(([index, size, offset]) => {
      gl.enableVertexAttribArray(index);
      gl.vertexAttribPointer(index, size, gl.FLOAT, false, 40, offset);
    });
    if (onTop) gl.disable(gl.DEPTH_TEST);
    gl.depthMask(false);
    gl.drawArrays(gl.TRIANGLES, 0, count * 6);
    gl.depthMask(true);
    gl.enable(gl.DEPTH_TEST);
    gl.disableVertexAttribArray(2);
    gl.disableVertexAttribArray(3);
  }
  release(path) { this.gl.deleteBuffer(path.buffer); }
  forget(mesh) { for (const buffer of [...mesh.buffers, mesh.index]) this.gl.deleteBuffer(buffer); }
  end() {}
}

/* Painter's algorithm: every face sorted by depth. Enough for a browser without WebGL. */
class PlainRenderer {
  constructor(canvas) {
    this.canvas = canvas;
    this.g = canvas.getContext("2d");
  }
  mesh(points, normals, triangles) { return { points, normals, triangles }; }
  begin(view, eye, background) {
    this.view = view;
    this.eye = eye;
    this.faces = [];
    this.under = [];
    this.g.fillStyle = rgb(background);
    this.g.fillRect(0, 0, this.canvas.width, this.canvas.height);
  }
  screen(p) {
    const [x, y, , w] = M4.point(this.view, p);
    return w < 0.05 ? null : [(x / w * 0.5 + 0.5) * this.canvas.width, (0.5 - y / w * 0.5) * this.canvas.height, w];
  }
  drawMesh(mesh, model, tint, alpha = 1, flatness = 0) {
    const count = mesh.points.length / 3, world = new Array(count), seen = new Array(count);
    for (let i = 0; i < count; i++) {
      world[i] = M4.point(model, mesh.points.subarray(3 * i, 3 * i + 3));
      seen[i] = this.screen(world[i]);
    }
    for (let k = 0; k < mesh.triangles.length; k += 3) {
      const [a, b, c] = [mesh.triangles[k], mesh.triangles[k + 1], mesh.triangles[k + 2]];
      if (!seen[a] || !seen[b] || !seen[c]) continue;
      let n = unit(cross(minus(world[b], world[a]), minus(world[c], world[a])));
      const facing = dot(n, minus(this.eye, world[a]));
      if (facing < 0 && alpha === 1 && !flatness) continue;
      if (facing < 0) n = n.map((v) => -v);
      const light = flatness ? 1 : 0.42 + 0.24 * (0.5 + 0.5 * n[2]) + 0.5 * Math.max(dot(n, LIGHT), 0);
      const depth = (seen[a][2] + seen[b][2] + seen[c][2]) / 3;
      this.faces.push({ corners: [seen[a], seen[b], seen[c]], depth, fill: rgb(tint.map((v) => v * light)), alpha });
    }
  }
  drawShadows() {}
  path(points, tints, strip, widths) { return { points, tints, strip, widths, count: strip ? points.length / 3 - 1 : points.length / 6 }; }
  drawPath(path, { count = path.count, wide = 2, alpha = 1, onTop = false } = {}) {
    const { points, tints, strip, widths } = path;
    for (let k = 0; k < count; k++) {
      const i = strip ? k : 2 * k;
      const a = this.screen(points.subarray(3 * i, 3 * i + 3)), b = this.screen(points.subarray(3 * i + 3, 3 * i + 6));
      if (!a || !b) continue;
      const depth = onTop ? 0 : (a[2] + b[2]) / 2, fill = rgb([...tints.subarray(3 * i, 3 * i + 3)]);
      const onFloor = points[3 * i + 2] === 0 && points[3 * i + 5] === 0;
      const width = wide * (widths ? widths[i] : 1) * (window.devicePixelRatio || 1);
      (onFloor ? this.under : this.faces).push({ corners: [a, b], depth, fill, alpha, width });
    }
  }
  release() {}
  forget() {}
  end() {
    const g = this.g;
    for (const list of [this.under, this.faces.sort((a, b) => b.depth - a.depth)]) {
      for (const { corners, fill, alpha, width } of list) {
        g.globalAlpha = alpha;
        g.lineWidth = width || 1;
        g.beginPath();
        corners.forEach(([x, y], k) => (k ? g.lineTo(x, y) : g.moveTo(x, y)));
        g.strokeStyle = g.fillStyle = fill;
        if (corners.length > 2) { g.closePath(); g.fill(); }
        g.stroke();
      }
    }
    g.globalAlpha = 1;
  }
}
const rgb = (c) => `rgb(${c.map((v) => Math.round(Math.min(Math.max(v, 0), 1) * 255)).join(",")})`;
