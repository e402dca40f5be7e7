// Points, cameras with their pictures and surfaces in space: what a card's controls choose is what is drawn.
"use strict";

const SHADERS = {
  points: [`#version 300 es
in vec3 place; in vec3 color; uniform mat4 view; uniform vec3 low, span; uniform float size, picking; out vec3 tint;
void main() {
  gl_Position = view * vec4(low + span * place, 1.0);
  gl_PointSize = clamp(size / gl_Position.w, 1.5, 40.0);
  int id = gl_VertexID + 1;
  tint = picking > 0.5 ? vec3(float(id & 255), float((id >> 8) & 255), float(id >> 16)) / 255.0 : color;
}`, `#version 300 es
precision mediump float; in vec3 tint; out vec4 color;
void main() { vec2 away = gl_PointCoord - 0.5; if (dot(away, away) > 0.25) discard; color = vec4(tint, 1.0); }`],
  lines: [`#version 300 es
in vec3 place; in vec3 color; uniform mat4 view; out vec3 tint;
void main() { gl_Position = view * vec4(place, 1.0); tint = color; }`, `#version 300 es
precision mediump float; in vec3 tint; out vec4 color;
void main() { color = vec4(tint, 1.0); }`],
  surfaces: [`#version 300 es
in vec3 place; in vec3 color; uniform mat4 view; uniform vec3 low, span; out vec3 tint, at;
void main() { at = low + span * place; gl_Position = view * vec4(at, 1.0); tint = color; }`, `#version 300 es
precision highp float; in vec3 tint, at; out vec4 color;
void main() {
  vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
  color = vec4(tint * (0.62 + 0.38 * abs(dot(normal, normalize(vec3(0.35, -0.5, 0.79))))), 1.0);
}`],
  pictures: [`#version 300 es
in vec3 place; in vec2 corner; uniform mat4 view; uniform float picking, first; out vec2 at; flat out vec3 number;
void main() {
  gl_Position = view * vec4(place, 1.0); at = corner;
  int id = int(first) + gl_VertexID / 6 + 1;
  number = vec3(float(id & 255), float((id >> 8) & 255), float(id >> 16)) / 255.0;
}`, `#version 300 es
precision mediump float; in vec2 at; flat in vec3 number; uniform sampler2D sheet; uniform float picking; out vec4 color;
void main() { color = vec4(picking > 0.5 ? number : texture(sheet, at).rgb, 1.0); }`],
};

function unpacked(text, Kind) {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i += 1) bytes[i] = letters.charCodeAt(i);
  return new Kind(bytes.buffer);
}

function lengthInWords(meters) {
  if (meters < 0.01) return `${(1000 * meters).toFixed(1)} mm`;
  return meters < 1 ? `${(100 * meters).toFixed(meters < 0.1 ? 1 : 0)} cm` : `${meters.toFixed(1)} m`;
}

const minus = (a, b) => a.map((value, k) => value - b[k]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const long = Math.hypot(...a) || 1; return a.map((value) => value / long); };

// The eye goes round a target; z is up. Angles in radians, lengths in meters.
class Eye {
  constructor(box, along) {
    this.box = box;
    this.along = along;
    this.look("space");
  }

  look(from) {
    const [low, high] = this.box;
    this.target = low.map((value, k) => 0.5 * (value + high[k]));
    const side = this.along - Math.PI / 2;
    [this.turn, this.tilt] = { space: [side + 0.55, 0.42], plan: [side, 1.5707], elevation: [side, 0.03] }[from];
    this.fit = 0.5 * Math.hypot(...minus(high, low)) / 0.42;
    this.far = 0;
  }

  distance(aspect) {
    if (!this.far) {  // the nearest place from which all corners of the box are seen
      const [low, high] = this.box, { right, up, back } = this.axes();
      let need = 0.1;
      for (let k = 0; k < 8; k += 1) {
        const corner = minus([0, 1, 2].map((axis) => ((k >> axis) & 1 ? high : low)[axis]), this.target);
        const wide = Math.abs(dot(corner, right)) / (0.39 * aspect), tall = Math.abs(dot(corner, up)) / 0.39;
        need = Math.max(need, dot(corner, back) + Math.max(wide, tall));
      }
      this.far = need;
    }
    return this.far;
  }

  axes() {
    const back = [Math.cos(this.turn) * Math.cos(this.tilt), Math.sin(this.turn) * Math.cos(this.tilt), Math.sin(this.tilt)];
    const right = [-Math.sin(this.turn), Math.cos(this.turn), 0];
    return { back, right, up: cross(back, right) };
  }

  matrix(aspect) {
    const far = this.distance(aspect), { back, right, up } = this.axes();
    const at = this.target.map((value, k) => value + far * back[k]);
    const focal = 1 / 0.41421356, near = Math.max(0.02, far / 500), end = far + 4 * this.fit + 100;
    const view = [right, up, back].map((axis) => [...axis, -dot(axis, at)]);
    const p = (end + near) / (near - end), q = (2 * end * near) / (near - end), out = new Float32Array(16);
    for (let column = 0; column < 4; column += 1) {
      out[4 * column] = (focal / aspect) * view[0][column];
      out[4 * column + 1] = focal * view[1][column];
      out[4 * column + 2] = p * view[2][column] + (column === 3 ? q : 0);
      out[4 * column + 3] = -view[2][column];
    }
    return out;
  }

  drag(x, y, height, pan) {
    if (!pan) {
      this.turn -= (3.2 * x) / height;
      this.tilt = Math.max(-1.5, Math.min(1.5707, this.tilt + (3.2 * y) / height));
      return;
    }
    const { right, up } = this.axes(), step = (0.83 * this.far) / height;
    this.target = this.target.map((value, k) => value + step * (y * up[k] - x * right[k]));
  }

  zoom(factor) { this.far = Math.max(0.2, Math.min(20 * this.fit, this.far * factor)); }
}

// WebGL: programs and buffers of one canvas.
class Pen {
  constructor(canvas) {
    this.gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    this.programs = {};
  }

  program(parts) {
    const { gl } = this, made = gl.createProgram();
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, k) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, parts[k]);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    });
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) || "shaders");
    return made;
  }

  buffer(values, kind) {
    const { gl } = this, made = gl.createBuffer();
    gl.bindBuffer(kind || gl.ARRAY_BUFFER, made);
    gl.bufferData(kind || gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
    return made;
  }

  // A target without smoothed edges, whose colors are numbers.
  numbered(width, height) {
    const { gl } = this;
    if (!this.target) this.target = { frame: gl.createFramebuffer(), color: gl.createRenderbuffer(), depth: gl.createRenderbuffer() };
    const { frame, color, depth } = this.target;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    for (const [store, format, place] of [[color, gl.RGBA8, gl.COLOR_ATTACHMENT0], [depth, gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, store);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, store);
    }
  }

  use(name, columns, numbers) {  // columns: name → [buffer, width, type, scaled to 1]
    const { gl } = this, program = this.programs[name] ||= this.program(SHADERS[name]);
    gl.useProgram(program);
    for (const [column, [buffer, width, type, scaled]] of Object.entries(columns)) {
      const place = gl.getAttribLocation(program, column);
      if (place < 0) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, width, type, scaled, 0, 0);
    }
    for (const [number, value] of Object.entries(numbers)) {
      const place = gl.getUniformLocation(program, number);
      if (value.length === 16) gl.uniformMatrix4fv(place, false, value);
      else if (value.length === 3) gl.uniform3fv(place, value);
      else gl.uniform1f(place, value);
    }
  }
}

class Space {
  constructor(card) {
    this.card = card;
    this.told = JSON.parse(card.querySelector("script").textContent);
    this.canvas = card.querySelector("canvas");
    this.slider = card.querySelector("input[name=limit]");
    this.pen = new Pen(this.canvas);
    if (!this.pen.gl) {
      card.querySelector(".none").hidden = false;
      return;
    }
    this.eye = new Eye(this.told.box, this.told.along);
    this.load();
    this.filter();
    this.listen();
    this.steer();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  checked(name) { return this.card.querySelector(`input[name=${name}]`)?.checked; }

  load() {
    const { told, pen } = this, { gl } = pen;
    Object.assign(this, {
      place: unpacked(told.place, Uint16Array), photo: unpacked(told.color, Uint8Array),
      segment: unpacked(told.segment, Uint8Array), level: unpacked(told.level, Uint8Array),
      instance: unpacked(told.instance, Uint16Array),
    });
    this.top = told.levels.length - 2;
    this.grain = 0.0045 * Math.min(this.eye.fit, 40) * Math.max(1, Math.min(2.5, Math.sqrt(8000 / Math.max(told.count, 1))));  // few points are drawn larger
    this.span = told.step.map((step) => 65535 * step);
    this.buffers = { place: pen.buffer(this.place), color: pen.buffer(new Uint8Array(3 * told.count)), rows: gl.createBuffer() };
    this.paints = {
      photo: (i) => this.photo.subarray(3 * i, 3 * i + 3),
      class: (i) => told.classes[this.segment[i]]?.color || [0, 0, 0],
      instance: (i) => told.instances[this.instance[i]].color,
      uncertainty: (i) => told.levels[this.level[i]],
    };
    if (told.seen) {
      this.seen = { image: unpacked(told.seen.image, Uint16Array), uv: unpacked(told.seen.uv, Uint16Array),
        first: new Uint32Array(told.count + 1) };
      unpacked(told.seen.views, Uint8Array).forEach((views, i) => { this.seen.first[i + 1] = this.seen.first[i] + views; });
    }
    if (told.mesh) {
      const color = unpacked(told.mesh.color, Uint8Array), corners = new Uint8Array(3 * color.length);
      for (let k = 0; k < corners.length; k += 1) corners[k] = color[3 * Math.floor(k / 9) + (k % 3)];
      const place = unpacked(told.mesh.place, Uint16Array);
      this.mesh = { count: place.length / 3, place: pen.buffer(place), color: pen.buffer(corners), low: told.mesh.low,
        span: told.mesh.step.map((step) => 65535 * step) };
    }
    this.loadCameras();
  }

  loadCameras() {
    const { told, pen } = this, { gl } = pen, flight = told.flight;
    const lines = [], colors = [], quads = [], corners = [];
    const line = (a, b, color) => { lines.push(...a, ...b); colors.push(...color, ...color); };
    flight.cameras.forEach((camera, k) => {
      const color = camera.ok ? [61, 124, 192] : [209, 69, 59], m = camera.pose, eye = [m[3], m[7], m[11]];
      if (k && flight.path) line(flight.cameras[k - 1].eye, eye, [120, 150, 190]);
      camera.eye = eye;
      const far = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => {
        const local = [x * flight.half[0] * flight.depth, y * flight.half[1] * flight.depth, flight.depth];
        return [0, 1, 2].map((row) => m[4 * row] * local[0] + m[4 * row + 1] * local[1] + m[4 * row + 2] * local[2] + m[4 * row + 3]);
      });
      far.forEach((corner, j) => { line(eye, corner, color); line(corner, far[(j + 1) % 4], color); });
      if (!flight.sheet || camera.cell < 0) return;
      const column = camera.cell % flight.sheet.columns, row = Math.floor(camera.cell / flight.sheet.columns);
      for (const j of [0, 1, 2, 0, 2, 3]) {
        quads.push(...far[j]);
        corners.push((column + (j === 1 || j === 2 ? 1 : 0)) / flight.sheet.columns, (row + (j > 1 ? 1 : 0)) / flight.sheet.rows);
      }
    });
    this.pictured = flight.cameras.map((camera, k) => k).filter((k) => flight.sheet && flight.cameras[k].cell >= 0);
    this.lines = { count: lines.length / 3, place: pen.buffer(new Float32Array(lines)), color: pen.buffer(new Uint8Array(colors)) };
    this.quads = { count: quads.length / 3, place: pen.buffer(new Float32Array(quads)), corner: pen.buffer(new Float32Array(corners)) };
    this.rays = { count: 0, place: gl.createBuffer(), color: gl.createBuffer() };
    if (!this.quads.count) return;
    const picture = new Image();
    picture.onload = () => {
      this.sheet = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, this.sheet);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
      gl.generateMipmap(gl.TEXTURE_2D);
      this.draw();
    };
    picture.src = flight.sheet.picture;
  }

  filter() {
    const { told, card, pen, top } = this, { gl } = pen;
    const limit = this.slider ? Number(this.slider.value) : top + 1, most = limit > top ? 255 : limit;
    const wanted = new Set();
    for (const box of card.querySelectorAll("input[name=class]:checked")) wanted.add(Number(box.value));
    const rows = [];
    for (let i = 0; i < told.count; i += 1) if (wanted.has(this.segment[i]) && this.level[i] <= most) rows.push(i);
    this.rows = new Uint32Array(rows);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers.rows);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.rows, gl.DYNAMIC_DRAW);
    this.paint();
  }

  paint() {
    const { told, card, pen } = this, { gl } = pen;
    const name = card.querySelector("input[name^=paint]:checked").value, paint = this.paints[name];
    this.colors = new Uint8Array(3 * told.count);
    for (let i = 0; i < told.count; i += 1) this.colors.set(paint(i), 3 * i);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.color);
    gl.bufferData(gl.ARRAY_BUFFER, this.colors, gl.DYNAMIC_DRAW);
    for (const part of card.querySelectorAll("[data-paint]")) part.hidden = part.dataset.paint !== name;
    card.querySelector("output.count").textContent =
      `${this.rows.length.toLocaleString("en")} of ${told.count.toLocaleString("en")} points` + (told.every > 1 ? `; one of ${told.every} is drawn` : "");
    this.draw();
  }

  draw(picking) {
    const { canvas, pen, told, buffers } = this, { gl } = pen, ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return;
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const view = this.eye.matrix(width / height), size = Number(this.card.querySelector("input[name=size]")?.value || 1);
    if (picking) pen.numbered(width, height);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const hidden = picking ? 1 : 0;
    if (this.mesh && this.checked("surfaces")) {
      gl.colorMask(!picking, !picking, !picking, !picking);  // while picking, surfaces only hide
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(2, 2);
      pen.use("surfaces", { place: [this.mesh.place, 3, gl.UNSIGNED_SHORT, true], color: [this.mesh.color, 3, gl.UNSIGNED_BYTE, true] },
        { view, low: this.mesh.low, span: this.mesh.span });
      gl.drawArrays(gl.TRIANGLES, 0, this.mesh.count);
      gl.disable(gl.POLYGON_OFFSET_FILL);
      gl.colorMask(true, true, true, true);
    }
    pen.use("points", { place: [buffers.place, 3, gl.UNSIGNED_SHORT, true], color: [buffers.color, 3, gl.UNSIGNED_BYTE, true] },
      { view, low: told.low, span: this.span, picking: hidden, size: this.grain * size * height });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.rows);
    gl.drawElements(gl.POINTS, this.rows.length, gl.UNSIGNED_INT, 0);
    if (this.checked("pictures") && this.sheet) {
      gl.bindTexture(gl.TEXTURE_2D, this.sheet);
      pen.use("pictures", { place: [this.quads.place, 3, gl.FLOAT, false], corner: [this.quads.corner, 2, gl.FLOAT, false] },
        { view, picking: hidden, first: told.count });
      gl.drawArrays(gl.TRIANGLES, 0, this.quads.count);
    }
    if (picking) return;
    for (const [name, lines] of [["cameras", this.lines], ["", this.rays]]) {
      if (!lines.count || (name && !this.checked(name))) continue;
      pen.use("lines", { place: [lines.place, 3, gl.FLOAT, false], color: [lines.color, 3, gl.UNSIGNED_BYTE, true] }, { view });
      gl.drawArrays(gl.LINES, 0, lines.count);
    }
  }

  at(i) { return [0, 1, 2].map((k) => this.told.low[k] + this.told.step[k] * this.place[3 * i + k]); }

  // Where a place of the world appears: pixels of the canvas from its lower left corner.
  pixel(place) {
    const m = this.eye.matrix(this.canvas.width / this.canvas.height), at = [...place, 1];
    const clip = [0, 1, 3].map((row) => at.reduce((sum, value, k) => sum + m[4 * k + row] * value, 0));
    return [0, 1].map((k) => Math.floor(0.5 * (clip[k] / clip[2] + 1) * [this.canvas.width, this.canvas.height][k]));
  }

  // What is drawn around a pixel: the number of a point, or of a camera behind all of them, or -1.
  pick([x, y], reach) {
    const { gl } = this.pen, side = 2 * reach + 1, pixels = new Uint8Array(4 * side * side);
    this.draw(true);
    gl.readPixels(x - reach, y - reach, side, side, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.draw();
    let best = -1, nearest = Infinity;
    for (let k = 0; k < side * side; k += 1) {
      const id = pixels[4 * k] + 256 * pixels[4 * k + 1] + 65536 * pixels[4 * k + 2];
      const away = Math.hypot((k % side) - reach, Math.floor(k / side) - reach);
      if (id && pixels[4 * k + 3] === 255 && away < nearest) [best, nearest] = [id - 1, away];
    }
    return best;
  }

  listen() {
    const { card, told } = this;
    const sayLimit = () => {
      const limit = told.ends[0] * Math.pow(told.ends[1] / told.ends[0], this.slider.value / this.top);
      card.querySelector("output.limit").textContent = this.slider.value > this.top ? "any" : lengthInWords(limit);
    };
    if (this.slider) this.slider.addEventListener("input", () => { sayLimit(); this.filter(); });
    for (const control of card.querySelectorAll("input")) {
      if (control === this.slider) continue;
      const act = control.name === "class" ? () => this.filter() : control.type === "radio" ? () => this.paint() : () => this.draw();
      control.addEventListener(control.type === "range" ? "input" : "change", act);
    }
    for (const button of card.querySelectorAll("button")) {
      button.addEventListener("click", () => {
        if (button.dataset.look) { this.eye.look(button.dataset.look); this.draw(); return; }
        for (const box of card.querySelectorAll("input[name=class]")) box.checked = button.value === "all";
        this.filter();
      });
    }
  }

  steer() {
    const { canvas, eye } = this, held = new Map();
    let moved = 0;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.clientX, event.clientY]);
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!held.has(event.pointerId)) return;
      const before = [...held.values()], [x, y] = held.get(event.pointerId);
      held.set(event.pointerId, [event.clientX, event.clientY]);
      const after = [...held.values()], [dx, dy] = [event.clientX - x, event.clientY - y];
      moved += Math.abs(dx) + Math.abs(dy);
      const height = canvas.clientHeight;
      if (held.size > 1) {
        const apart = (two) => Math.hypot(two[0][0] - two[1][0], two[0][1] - two[1][1]) || 1;
        eye.zoom(apart(before) / apart(after));
        eye.drag(dx / 2, dy / 2, height, true);
      } else eye.drag(dx, dy, height, event.shiftKey || event.buttons > 1);
      this.draw();
    });
    const left = (event) => {
      if (held.delete(event.pointerId) && moved < 4 && event.type === "pointerup") this.choose(event);
    };
    canvas.addEventListener("pointerup", left);
    canvas.addEventListener("pointercancel", left);
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas) return;  // zooms only after a click: scrolling the page still works
      event.preventDefault();
      eye.zoom(Math.exp(0.0012 * event.deltaY));
      this.draw();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-30, 0], ArrowRight: [30, 0], ArrowUp: [0, -30], ArrowDown: [0, 30] }[event.key];
      const zoom = { "+": 0.85, "=": 0.85, "-": 1.18 }[event.key];
      if (step) eye.drag(...step, 640, event.shiftKey);
      else if (zoom) eye.zoom(zoom);
      else return;
      event.preventDefault();
      this.draw();
    });
  }

  choose(event) {
    const box = this.canvas.getBoundingClientRect(), ratio = this.canvas.width / box.width;
    const found = this.pick([Math.round((event.clientX - box.left) * ratio), Math.round((box.bottom - event.clientY) * ratio)], 4);
    this.tell(found);
  }

  // Say what is known of a point or a camera, and draw the rays from a point to the cameras that saw it.
  tell(found) {
    const { told, card, pen } = this, { gl } = pen, panel = card.querySelector(".picked");
    this.rays.count = 0;
    panel.replaceChildren();
    panel.hidden = found < 0;
    if (found >= told.count) this.tellCamera(panel, this.pictured[found - told.count]);
    else if (found >= 0) {
      const at = this.at(found), rays = this.tellPoint(panel, found).flatMap((camera) => [...at, ...camera.eye]);
      this.rays.count = rays.length / 3;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.rays.place);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(rays), gl.DYNAMIC_DRAW);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.rays.color);
      gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(rays.map((value, k) => [235, 160, 40][k % 3])), gl.DYNAMIC_DRAW);
    }
    this.draw();
  }

  rowsOf(panel, head, rows) {
    const list = document.createElement("dl"), title = document.createElement("b");
    title.textContent = head;
    for (const [name, value] of rows) {
      const [left, right] = [document.createElement("dt"), document.createElement("dd")];
      [left.textContent, right.textContent] = [name, value];
      list.append(left, right);
    }
    panel.append(title, list);
  }

  tellPoint(panel, i) {
    const { told } = this, level = this.level[i], own = told.instances[this.instance[i]];
    const limit = told.ends[0] * Math.pow(told.ends[1] / told.ends[0], level / this.top);
    const sure = level > this.top ? "not known" : level === 0 ? "1 mm or less" : level === this.top ? "10 m or more" : `about ${lengthInWords(limit)}`;
    const at = this.at(i).map((value, k) => (value + told.origin[k]).toFixed(2)).join(", ");
    this.rowsOf(panel, "Point", [["class", told.classes[this.segment[i]]?.name || "–"], ["instance", own.id || "none"],
      ["kind", own.kind || "–"], ["uncertainty", sure], ["place", `${at} ${told.unit}`]]);
    if (!this.seen || this.seen.first[i + 1] === this.seen.first[i]) return [];
    const list = document.createElement("ul"), cameras = [], all = told.seen.of ? unpacked(told.seen.of, Uint16Array)[i] : 0;
    for (let k = this.seen.first[i]; k < this.seen.first[i + 1]; k += 1) {
      const camera = told.flight.cameras.find((one) => one.row === this.seen.image[k]), row = document.createElement("li");
      const uv = [0, 1].map((axis) => (this.seen.uv[2 * k + axis] * told.seen.step).toFixed(1)).join(", ");
      row.append(this.link(camera, told.seen.names[this.seen.image[k]]), ` at (${uv})`);
      list.append(row);
      if (camera) cameras.push(camera);
    }
    const words = document.createElement("span");
    words.textContent = `seen by ${all} images` + (all > list.children.length ? `, these among them [px]:` : " [px]:");
    panel.append(words, list);
    return cameras;
  }

  link(camera, name) {
    const link = document.createElement(camera?.file ? "a" : "span");
    link.textContent = name;
    if (camera?.file) link.href = camera.file;
    return link;
  }

  tellCamera(panel, k) {
    const { flight } = this.told, camera = flight.cameras[k], sheet = flight.sheet;
    this.rowsOf(panel, "Image", [["status", camera.status], ["place", camera.eye.map((value, axis) => (value + this.told.origin[axis]).toFixed(2)).join(", ") + ` ${this.told.unit}`]]);
    const crop = document.createElement("i"), column = camera.cell % sheet.columns, row = Math.floor(camera.cell / sheet.columns);
    crop.className = "crop";
    crop.style.backgroundImage = `url(${sheet.picture})`;
    crop.style.backgroundSize = `${100 * sheet.columns}% ${100 * sheet.rows}%`;
    crop.style.backgroundPosition = `${sheet.columns > 1 ? (100 * column) / (sheet.columns - 1) : 0}% ${sheet.rows > 1 ? (100 * row) / (sheet.rows - 1) : 0}%`;
    panel.append(crop, this.link(camera, camera.name));
  }
}

later(document.querySelectorAll(".card.space"), (card) => { card.space = new Space(card); });
