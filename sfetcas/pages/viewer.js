"use strict";
/* Draws the answer that the page holds: members by WebGL, symbols and numbers over them, charts and tables beside. */
(async () => {
  const $ = (id) => document.getElementById(id);
  const data = JSON.parse($("content").textContent);
  const { states, members, quantities } = data;
  const UNITS = {
    position: "m", angle: "rad", velocity: "m/s", angular_velocity: "rad/s", force: "N", moment: "N m", energy: "J",
    gap: "m", tension: "N", length: "m", torque: "N m", friction: "N", omega: "rad/s", mass: "kg", time: "s",
  };
  const COLOURS = {
    signed: [[0, 33, 80, 160], [0.25, 103, 153, 205], [0.5, 205, 205, 205], [0.75, 228, 135, 105], [1, 172, 30, 40]],
    sizes: [[0, 190, 200, 212], [0.25, 110, 175, 175], [0.5, 65, 135, 125], [0.75, 120, 95, 40], [1, 150, 40, 20]],
  };
  const PLAIN = [0.122, 0.227, 0.373];
  const PAUSE = 250, SLOW = 30;
  const MEMBER = 2.6, NEAR = 12, ARROW = 80, SMOOTH = 2, LARGEST = 1.6e7, UNFELT = 1e-9, SMALL = 1e-6, MOST_RECORDS = 200, LOST = 1e30;

  /** States that are no part of a course. */
  const BESIDE = ["step", "flutter point", "live"];

  // -- what the page holds --------------------------------------------------------------------------------------------

  const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const unpack = (text) => {
    const bytes = bytesOf(text);
    return data.bits === 64 ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer);
  };
  const kept = new Map();
  const numbers = (owner, key) => {
    const packed = owner[key];
    if (packed === null || packed === undefined) return null;
    if (typeof packed !== "string") return packed;
    let known = kept.get(packed);
    if (!known) kept.set(packed, (known = unpack(packed)));
    return known;
  };
  const starts = [0];
  for (const member of members) starts.push(starts[starts.length - 1] + member.x.length);
  const total = starts[starts.length - 1];
  const linesOf = (number) => numbers(states[number], "lines");

  let state = states.length - 1, mode = 0, phase = 0, amplitude = 1, colour = "", picked = null, playing = 0;
  // Loads grow along steps and paths; of all equilibria of a step the first is the usual one.
  if (data.kind === "dynamic" || data.modes.length) state = 0;
  else if (data.all) state = states.findIndex((one) => one.at === states[states.length - 1].at);
  else if (data.kind === "path") state = states.findLastIndex((one) => one.branch === 0 && !BESIDE.includes(one.kind));

  /** Places of all members as they are drawn now: those of a mode move. */
  const drawn = () => {
    const lines = linesOf(state);
    if (!data.modes.length) return lines;
    const real = numbers(data.modes[mode], "real"), imaginary = numbers(data.modes[mode], "imaginary");
    const c = amplitude * Math.cos(phase), s = amplitude * Math.sin(phase), moved = new Float64Array(lines.length);
    for (let i = 0; i < moved.length; i++) moved[i] = lines[i] + c * real[i] - (imaginary ? s * imaginary[i] : 0);
    return moved;
  };

  // -- camera ---------------------------------------------------------------------------------------------------------

  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const box = { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
  const widen = (line) => {
    for (let i = 0; i < line.length; i++) {
      const axis = i % 3;
      if (line[i] < box.low[axis]) box.low[axis] = line[i];
      if (line[i] > box.high[axis]) box.high[axis] = line[i];
    }
  };
  widen(numbers(data, "rest"));
  states.forEach((_, number) => widen(linesOf(number)));
  const extent = Math.hypot(...[0, 1, 2].map((axis) => box.high[axis] - box.low[axis]));
  const origin = [0, 1, 2].map((axis) => 0.5 * (box.low[axis] + box.high[axis]));
  // Some places of all that is seen, but for obstacles, which may be large.
  const cloud = [];
  const gather = (line, most) => {
    const every = Math.max(1, Math.ceil(line.length / 3 / most));
    for (let i = 0; i + 2 < line.length; i += 3 * every) if (Number.isFinite(line[i])) cloud.push(line[i], line[i + 1], line[i + 2]);
  };
  gather(numbers(data, "rest"), 2000);
  states.forEach((_, number) => gather(linesOf(number), Math.max(20, 20000 / states.length)));
  for (const one of data.modes) for (const sign of [1, -1]) gather(Float64Array.from(linesOf(0), (place, i) => place + sign * numbers(one, "real")[i]), 200);
  for (const symbol of data.symbols) if (!symbol.obstacle) gather(symbol.points, 40);
  const camera = { centre: [...origin], right: [...data.view.right], up: [...data.view.up], scale: 1 };
  const size = { width: 1, height: 1, ratio: 1 };

  /** Pixels from the left and from above of a place. */
  const seen = (x, y, z) => {
    const d = [x - camera.centre[0], y - camera.centre[1], z - camera.centre[2]];
    return [0.5 * size.width + camera.scale * dot(camera.right, d), 0.5 * size.height - camera.scale * dot(camera.up, d)];
  };
  const fit = () => {
    camera.centre = [...origin];
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let i = 0; i < cloud.length; i += 3) {
      const d = [0, 1, 2].map((axis) => cloud[i + axis] - origin[axis]), x = dot(camera.right, d), y = dot(camera.up, d);
      [left, right, low, high] = [Math.min(left, x), Math.max(right, x), Math.min(low, y), Math.max(high, y)];
    }
    camera.centre = camera.centre.map((one, i) => one + 0.5 * ((left + right) * camera.right[i] + (low + high) * camera.up[i]));
    const [width, height] = [right - left, high - low], one = Math.max(width, height) || 1;
    // Around it there is room for numbers, tools and the legend.
    const free = [size.width - 110, size.height - 130].map((x) => Math.max(x, 40));
    camera.scale = Math.min(free[0] / Math.max(width, 1e-3 * one), free[1] / Math.max(height, 1e-3 * one));
  };
  const look = (right, up) => {
    camera.right = right;
    camera.up = up;
    fit();
    draw();
  };
  const turned = (vector, axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle), w = cross(axis, vector), k = dot(axis, vector) * (1 - c);
    return vector.map((x, i) => c * x + s * w[i] + k * axis[i]);
  };
  const turn = (dx, dy) => {
    const { right, up } = camera;
    const about = (v) => turned(turned(v, up, -dx / 150), right, -dy / 150);
    const [r, u] = [about(right), about(up)];
    // What rounding has left is taken out, so that any number of turns keeps the shape.
    const length = Math.hypot(...r);
    camera.right = r.map((x) => x / length);
    const share = dot(camera.right, u), across = u.map((x, i) => x - share * camera.right[i]), high = Math.hypot(...across);
    camera.up = across.map((x) => x / high);
  };
  const pan = (dx, dy) => {
    for (let i = 0; i < 3; i++) camera.centre[i] += (-dx * camera.right[i] + dy * camera.up[i]) / camera.scale;
  };
  const zoom = (factor, x, y) => {
    const dx = x - 0.5 * size.width, dy = y - 0.5 * size.height;
    pan(-dx, -dy);
    camera.scale *= factor;
    pan(dx, dy);
  };

  // -- members --------------------------------------------------------------------------------------------------------

  const VERTEX = `#version 300 es
    precision highp float;
    layout(location = 0) in vec2 corner;
    layout(location = 1) in vec3 a;
    layout(location = 2) in vec3 b;
    layout(location = 3) in vec2 told;
    uniform vec3 right, up, toward, centre;
    uniform float scale, radius, depth;
    uniform vec2 size;
    out vec2 place;
    out float span, value;
    vec3 view(vec3 p) { vec3 d = p - centre; return vec3(dot(right, d), dot(up, d), dot(toward, d)); }
    void main() {
      vec3 A = view(a), B = view(b);
      vec2 along = scale * (B.xy - A.xy);
      span = length(along);
      vec2 t = span > 1e-4 ? along / span : vec2(1.0, 0.0);
      vec2 n = vec2(-t.y, t.x);
      place = vec2(mix(-radius, span + radius, corner.x), corner.y * radius);
      vec2 pixel = scale * A.xy + t * place.x + n * place.y;
      gl_Position = vec4(2.0 * pixel / size, clamp(-mix(A.z, B.z, corner.x) / depth, -0.99, 0.99), 1.0);
      value = mix(told.x, told.y, corner.x);
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec2 place;
    in float span, value;
    uniform float radius, low, high, round;
    uniform vec3 plain;
    uniform bool coloured;
    uniform sampler2D bar;
    out vec4 shown;
    void main() {
      float off = length(vec2(place.x - clamp(place.x, 0.0, span), place.y));
      if (off > radius) discard;
      vec3 ink = plain;
      if (coloured) ink = value > 1e29 ? vec3(0.7) : texture(bar, vec2(clamp((value - low) / (high - low), 0.002, 0.998), 0.5)).rgb;
      float lit = mix(1.0, 0.62 + 0.45 * sqrt(max(0.0, 1.0 - place.y * place.y / (radius * radius))), round);
      shown = vec4(min(ink * lit, vec3(1.0)), 1.0);
    }`;

  const paper = $("members"), over = $("symbols"), under = $("behind");
  const gl = paper.getContext("webgl2", { alpha: true, antialias: true, preserveDrawingBuffer: true });
  const painter = gl ? prepared() : null;

  function prepared() {
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    const corners = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, corners);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    [[1, 3, 0], [2, 3, 12], [3, 2, 24]].forEach(([place, count, offset]) => {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, gl.FLOAT, false, 32, offset);
      gl.vertexAttribDivisor(place, 1);
    });
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, key, value);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    const place = (name) => gl.getUniformLocation(program, name);
    const names = ["right", "up", "toward", "centre", "scale", "radius", "depth", "size", "low", "high", "round", "plain", "coloured"];
    return Object.fromEntries(names.map((name) => [name, place(name)]));
  }

  /** Segments of all members: both ends, about the origin, and their values. */
  const segments = (lines, values) => {
    const found = new Float32Array(8 * total);
    let count = 0;
    for (let m = 0; m < members.length; m++) {
      for (let i = starts[m]; i + 1 < starts[m + 1]; i++) {
        const at = 8 * count++;
        for (let axis = 0; axis < 3; axis++) {
          found[at + axis] = lines[3 * i + axis] - origin[axis];
          found[at + 3 + axis] = lines[3 * i + 3 + axis] - origin[axis];
        }
        found[at + 6] = values ? told(values[i]) : 0;
        found[at + 7] = values ? told(values[i + 1]) : 0;
      }
    }
    return [found, count];
  };
  const told = (value) => (Number.isFinite(value) ? value : LOST);

  const sent = { lines: null, values: null, count: 0 };
  const paint = (lines, values) => {
    if (sent.lines !== lines || sent.values !== values) {
      const [found, count] = segments(lines, values);
      gl.bufferData(gl.ARRAY_BUFFER, found.subarray(0, 8 * count), gl.DYNAMIC_DRAW);
      Object.assign(sent, { lines, values, count });
    }
    gl.uniform1f(painter.radius, MEMBER);
    gl.uniform1f(painter.round, data.plane ? 0.4 : 1);
    gl.uniform3fv(painter.plain, PLAIN);
    gl.uniform1i(painter.coloured, values ? 1 : 0);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, sent.count);
  };

  const drawMembers = () => {
    $("legend").hidden = !colour || !states[state].values;
    const known = states[state].values, values = colour && known ? numbers(known, colour) || new Float64Array(total) : null;
    const lines = drawn();
    if (!gl) {
      trace(penOf(paper), lines, "#1f3a5f", 2 * MEMBER, values && ((i) => inkOf(0.5 * (values[i] + values[i + 1]))));
      return;
    }
    // Of large canvases browsers draw smaller ones.
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniform3fv(painter.right, camera.right);
    gl.uniform3fv(painter.up, camera.up);
    gl.uniform3fv(painter.toward, cross(camera.right, camera.up));
    gl.uniform3fv(painter.centre, camera.centre.map((x, i) => x - origin[i]));
    gl.uniform1f(painter.scale, camera.scale);
    gl.uniform1f(painter.depth, 2 * extent + 1e-30);
    gl.uniform2f(painter.size, size.width, size.height);
    const [low, high] = range(colour);
    gl.uniform1f(painter.low, low);
    gl.uniform1f(painter.high, high);
    paint(lines, values);
  };

  /** A canvas made empty, whose unit is a pixel of the page. */
  const penOf = (canvas) => {
    const pen = canvas.getContext("2d"), ratio = canvas.width / size.width;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, size.width, size.height);
    pen.font = '12px system-ui, "Segoe UI", "DejaVu Sans", sans-serif';
    pen.lineJoin = pen.lineCap = "round";
    return pen;
  };
  /** All members as flat lines, undeformed, or where there is no WebGL; `inks` gives the colours of their segments. */
  const trace = (pen, lines, ink, width, inks) => {
    pen.strokeStyle = ink;
    pen.lineWidth = width;
    pen.beginPath();
    members.forEach((_, m) => {
      for (let i = starts[m]; i < starts[m + 1]; i++) {
        const place = seen(lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]);
        if (i === starts[m]) pen.moveTo(...place);
        else pen.lineTo(...place);
        if (inks && i > starts[m]) {
          pen.strokeStyle = inks(i - 1);
          pen.stroke();
          pen.beginPath();
          pen.moveTo(...place);
        }
      }
    });
    if (!inks) pen.stroke();
  };

  // -- colours --------------------------------------------------------------------------------------------------------

  const ranges = {}, nothing = {};
  let pixels = null;
  const inkOf = (value) => {
    const [low, high] = range(colour), at = 4 * Math.round(255 * Math.min(Math.max((value - low) / (high - low), 0), 1));
    return Number.isFinite(value) ? `rgb(${pixels[at]}, ${pixels[at + 1]}, ${pixels[at + 2]})` : "#b3b3b3";
  };
  /** Least and largest value of a quantity in all states; alike on both sides of zero where it has a sign. */
  const range = (key) => {
    if (!key) return [0, 1];
    if (!ranges[key]) {
      let low = Infinity, high = -Infinity;
      for (const one of states) {
        const values = one.values ? numbers(one.values, key) || [0] : [];
        for (const value of values) if (Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
      }
      if (!(low <= high)) [low, high] = [0, 0];
      nothing[key] = low === 0 && high === 0;
      const most = Math.max(Math.abs(low), Math.abs(high)) || 1;
      if (quantities.find((one) => one.key === key).signed) [low, high] = [-most, most];
      ranges[key] = high > low ? [low, high] : [low - 0.5 * most, high + 0.5 * most];
    }
    return ranges[key];
  };
  const setColour = (key) => {
    colour = key;
    if (key) {
      const one = quantities.find((found) => found.key === key), stops = COLOURS[one.signed ? "signed" : "sizes"];
      pixels = new Uint8ClampedArray(4 * 256);
      for (let i = 0; i < 256; i++) {
        const x = i / 255, next = Math.max(1, stops.findIndex((stop) => stop[0] >= x)), [from, to] = [stops[next - 1], stops[next]];
        const share = (x - from[0]) / (to[0] - from[0]);
        pixels.set([1, 2, 3].map((c) => from[c] + share * (to[c] - from[c])), 4 * i);
        pixels[4 * i + 3] = 255;
      }
      $("bar").getContext("2d").putImageData(new ImageData(pixels, 256, 1), 0, 0);
      if (gl) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(pixels.buffer));
      showLegend();
    }
    draw();
  };
  const showLegend = () => {
    if (!colour) return;
    const one = quantities.find((found) => found.key === colour), [low, high] = range(colour), empty = nothing[colour];
    $("low").textContent = empty ? "" : short(Math.abs(low) < SMALL * high ? 0 : low);
    $("named").textContent = empty ? `${one.label}: 0 everywhere` : `${one.label}, ${one.unit}`;
    $("high").textContent = empty ? "" : short(high);
  };
  const short = (value) => {
    const found = Number(value.toPrecision(4));
    return found && Math.abs(found) < 1e-3 ? found.toExponential() : String(found);
  };

  // -- symbols --------------------------------------------------------------------------------------------------------

  const polyline = (pen, points) => {
    let before = false, last = null, previous = null;
    pen.beginPath();
    for (let i = 0; i < points.length; i += 3) {
      if (points[i] === null || points[i + 1] === null || points[i + 2] === null) {
        before = false;
        continue;
      }
      const place = seen(points[i], points[i + 1], points[i + 2]);
      pen[before ? "lineTo" : "moveTo"](...place);
      before = true;
      if (last && Math.hypot(place[0] - last[0], place[1] - last[1]) > 0.5) previous = last;
      last = place;
    }
    return [previous, last];
  };
  const head = (pen, from, to, length) => {
    if (!from) return;
    const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
    pen.beginPath();
    pen.moveTo(...to);
    for (const side of [1, -1]) pen.lineTo(to[0] - length * Math.cos(angle + 0.42 * side), to[1] - length * Math.sin(angle + 0.42 * side));
    pen.closePath();
    pen.fill();
  };
  const drawSymbol = (pen, symbol) => {
    pen.strokeStyle = pen.fillStyle = symbol.colour;
    pen.lineWidth = symbol.width;
    pen.setLineDash(symbol.dotted ? [2, 3] : []);
    if (symbol.kind === "dot") {
      pen.beginPath();
      pen.arc(...seen(...symbol.points), 3.6, 0, 2 * Math.PI);
      pen.fillStyle = symbol.fill;
      pen.fill();
      pen.stroke();
      return;
    }
    const [from, to] = polyline(pen, symbol.points);
    if (symbol.kind === "area") {
      pen.closePath();
      if (symbol.fill !== "none") {
        pen.fillStyle = symbol.fill;
        pen.fill();
      }
    }
    pen.stroke();
    pen.setLineDash([]);
    if (symbol.kind === "arrow" && to) head(pen, from, to, 6 + 2 * symbol.width);
  };
  const write = (pen, text, x, y, ink, align = "center") => {
    pen.textAlign = align;
    pen.textBaseline = "middle";
    pen.lineWidth = 3;
    pen.strokeStyle = "rgba(255, 255, 255, 0.85)";
    pen.strokeText(text, x, y);
    pen.fillStyle = ink;
    pen.fillText(text, x, y);
  };
  const arrow = (pen, from, vector, ink, text) => {
    const to = [from[0] + vector[0], from[1] + vector[1]];
    pen.strokeStyle = pen.fillStyle = ink;
    pen.lineWidth = 1.4;
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
    const length = Math.hypot(...vector);
    if (length > 6) head(pen, from, to, 7);
    if (text) write(pen, text, to[0] + (length ? 9 * vector[0] / length : 0), to[1] + (length ? 9 * vector[1] / length : -9), ink);
  };
  const corner = (pen) => {
    const at = [46, size.height - 62], flat = (v) => [dot(camera.right, v), -dot(camera.up, v)];
    const axes = [["x", [1, 0, 0], "#b03a2e"], ["y", [0, 1, 0], "#1e8449"], ["z", [0, 0, 1], "#2456a4"]];
    for (const [name, axis, ink] of axes.slice(0, data.plane ? 2 : 3)) arrow(pen, at, flat(axis).map((x) => 24 * x), ink, name);
    // Gravity grows with all loads, but in a motion, where it acts from the beginning.
    const by = upright ? 1 : states[state].at;
    if (data.gravity && by) {
      const length = Math.abs(by) * Math.hypot(...data.gravity), way = flat(data.gravity).map((x) => (24 * x * by) / length);
      arrow(pen, [at[0] + 62, at[1] - 8], way, data.inks.load, "");
      write(pen, `gravity ${short(length)} m/s²`, at[0] + 76, at[1] - 8, data.inks.load, "left");
    }
  };

  const nodesNow = () => states[state].told.nodes || {};
  /** Where what is picked is in a state, m. */
  const placeOf = (what, number) => {
    if (what.node !== undefined) return states[number].told.nodes[what.node].position;
    const i = 3 * (starts[what.member] + what.sample), lines = number === state ? drawn() : linesOf(number);
    return [lines[i], lines[i + 1], lines[i + 2]];
  };
  const drawSymbols = () => {
    const [pen, back] = [penOf(over), penOf(under)];
    if ($("show-rest").checked) {
      back.setLineDash([6, 5]);
      trace(back, data.modes.length ? linesOf(0) : numbers(data, "rest"), "#9a9a9a", 1.2);
      back.setLineDash([]);
    }
    const here = states[state];
    if ($("show-symbols").checked) {
      const symbols = here.symbols.map((one) => (typeof one === "object" ? one : data.symbols[one]));
      for (const symbol of [...symbols].sort((a, b) => a.level - b.level)) drawSymbol(symbol.level <= 1.5 ? back : pen, symbol);
    }
    if ($("show-labels").checked && $("show-symbols").checked) {
      const taken = [];
      for (const label of here.labels) {
        const [x, y] = seen(...label.at), length = Math.hypot(...label.away) || 1;
        const half = 0.5 * pen.measureText(label.text).width, [dx, dy] = label.away.map((one) => one / length);
        // Beside its symbol, on the side that hides least; where none is free it is left out.
        const ways = [[dx, dy], [-dx, -dy], [dy, -dx], [-dy, dx]].map(([a, b]) => [x + a * (half + 8), y - 14 * b]);
        const free = ways.find(([a, b]) => taken.every((other) => Math.abs(a - other[0]) > half + other[2] + 3 || Math.abs(b - other[1]) > 14));
        if (!free) continue;
        taken.push([...free, half]);
        write(pen, label.text, ...free, label.colour);
      }
    }
    if (!data.modes.length) {
      const names = Object.keys(nodesNow());
      pen.fillStyle = "#1f3a5f";
      if (names.length <= 10 * MOST_RECORDS) {
        for (const name of names) {
          pen.beginPath();
          pen.arc(...seen(...nodesNow()[name].position), 2.6, 0, 2 * Math.PI);
          pen.fill();
        }
      }
    }
    if (picked) drawPicked(pen);
    if (live && state === known) live.drawHandles(pen);
    corner(pen);
  };
  const drawPicked = (pen) => {
    if (known > 2 && !data.modes.length) {
      pen.setLineDash([1.5, 3]);
      pen.strokeStyle = data.inks.motion;
      pen.lineWidth = 1.4;
      pen.beginPath();
      states.forEach((one, number) => {
        if (BESIDE.includes(one.kind)) return;
        const place = seen(...placeOf(picked, number));
        pen[number && one.branch === states[number - 1].branch ? "lineTo" : "moveTo"](...place);
      });
      pen.stroke();
      pen.setLineDash([]);
    }
    const [x, y] = seen(...placeOf(picked, state));
    pen.strokeStyle = data.inks.motion;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(x, y, 7, 0, 2 * Math.PI);
    pen.stroke();
    write(pen, nameOf(picked), x, y - 18, data.inks.motion);
  };
  const nameOf = (what) => (what.node !== undefined ? what.node : `${members[what.member].name} at ${short(members[what.member].x[what.sample])}`);

  // -- drawing --------------------------------------------------------------------------------------------------------

  let waiting = false, drawnAt = 0, pace = 0, coarse = false, rest = 0;
  const draw = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame((stamp) => {
      waiting = false;
      // What moves all the time, and slowly, is drawn less fine until it stands still.
      const passed = stamp - drawnAt;
      pace = passed < PAUSE ? 0.8 * pace + 0.2 * passed : 0;
      drawnAt = stamp;
      if (!coarse && pace > SLOW) {
        coarse = true;
        sized();
      }
      clearTimeout(rest);
      if (coarse) {
        rest = setTimeout(() => {
          [pace, coarse] = [0, false];
          sized();
          draw();
        }, PAUSE);
      }
      drawMembers();
      drawSymbols();
    });
  };
  /** Give the canvases as many pixels as they need. */
  const sized = () => {
    for (const canvas of [paper, over, under]) {
      // Members are drawn finer than they are seen, which makes their edges smooth.
      const large = size.width * size.height * (SMOOTH * size.ratio) ** 2 > LARGEST;
      const ratio = size.ratio * (canvas === paper && !large && !coarse ? SMOOTH : 1);
      const [width, height] = [Math.round(size.width * ratio), Math.round(size.height * ratio)];
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    }
  };
  const resize = () => {
    const first = size.width === 1, frame = $("stage").getBoundingClientRect();
    const before = Math.min(size.width, size.height);
    [size.width, size.height, size.ratio] = [Math.max(frame.width, 1), Math.max(frame.height, 1), window.devicePixelRatio || 1];
    sized();
    if (first) fit();
    else camera.scale *= Math.min(size.width, size.height) / before;
    draw();
  };

  // -- tables ---------------------------------------------------------------------------------------------------------

  const made = (tag, text, parent) => {
    const found = document.createElement(tag);
    if (text !== undefined) found.textContent = text;
    if (parent) parent.append(found);
    return found;
  };
  const words = (value) => {
    if (value === null || value === undefined) return "none";
    if (Array.isArray(value)) return value.length && value.every((one) => typeof one === "number") ? `(${value.map(words).join(", ")})` : value.map(words).join("; ");
    if (typeof value === "object") return Object.entries(value).map(([key, one]) => `${key} ${words(one)}`).join(", ");
    return String(value);
  };
  const tableOf = (caption, record, parent) => {
    const table = made("table", undefined, parent);
    if (caption) made("caption", caption, table);
    for (const [key, value] of Object.entries(record)) {
      const row = made("tr", undefined, table);
      made("th", Object.hasOwn(UNITS, key) && value !== null ? `${key.replaceAll("_", " ")}, ${UNITS[key]}` : key.replaceAll("_", " "), row);
      made("td", words(value), row).dataset.key = key;
    }
    return table;
  };
  const showValues = (panel) => {
    panel.replaceChildren();
    if (!picked) {
      made("p", "Click a node, or a place on a member, and its values are told here in every state.", panel);
      return;
    }
    if (picked.node !== undefined) {
      const { nodes, reactions } = states[state].told;
      tableOf(`node ${picked.node}`, nodes[picked.node], panel);
      if (reactions && Object.hasOwn(reactions, picked.node)) tableOf("reaction of its support", reactions[picked.node], panel);
      return;
    }
    const { name, x } = members[picked.member], i = starts[picked.member] + picked.sample;
    const say = (value) => (data.bits === 64 ? value : Number(value.toPrecision(7)));
    const rest = data.modes.length ? linesOf(0).slice(3 * i, 3 * i + 3) : placeOf(picked, state);
    tableOf(`member ${name}`, { "fraction of its length": x[picked.sample], position: [...rest].map(say) }, panel);
    if (data.modes.length) {
      const shape = data.modes[mode], told = {};
      for (const part of ["real", "imaginary"]) {
        const moved = numbers(shape, part);
        if (moved && shape.scale) told[part === "real" ? "displacement" : "imaginary part"] = [...moved.slice(3 * i, 3 * i + 3)].map((one) => say(one / shape.scale));
      }
      tableOf("of the mode, whose largest is 1", told, panel);
      return;
    }
    const found = {};
    for (const one of states[state].values ? quantities : []) {
      const values = numbers(states[state].values, one.key);
      found[`${one.label}, ${one.unit}`] = values ? (Number.isFinite(values[i]) ? say(values[i]) : null) : 0;
    }
    tableOf("there", found, panel);
  };
  const TITLES = { nodes: "node", reactions: "reaction at", members: "member", springs: "spring", tendons: "tendon", tubes: "tube", rings: "ring", motions: "motion", magnets: "magnet", contacts: "contact" };
  const showAnswer = (panel) => {
    panel.replaceChildren();
    const here = data.modes.length && data.modes[mode].told ? { ...states[state].told, mode: data.modes[mode].told } : states[state].told;
    const single = {}, single_keys = Object.keys(here).filter((key) => typeof here[key] !== "object" || Array.isArray(here[key]));
    for (const key of single_keys) if (!(Array.isArray(here[key]) && !here[key].length)) single[key] = here[key];
    tableOf(states[state].text, single, panel);
    for (const key of ["mode", "certificate", "energy", "momentum"]) if (here[key]) tableOf(key, here[key], panel);
    for (const [kind, title] of Object.entries(TITLES)) {
      const records = Object.entries(here[kind] || {}).filter(([, record]) => Object.keys(record).length);
      for (const [name, record] of records.slice(0, MOST_RECORDS)) tableOf(`${title} ${name}`, record, panel);
      if (records.length > MOST_RECORDS) made("p", `... and ${records.length - MOST_RECORDS} more`, panel);
    }
  };

  // -- chart ----------------------------------------------------------------------------------------------------------

  const INKS = ["#134b86", "#b5532a", "#3a7d44", "#8f3b76", "#7a6a1f", "#2f6f8f"];
  const upright = data.kind === "dynamic";
  const courses = () => {
    const found = [];
    const names = Object.keys(states[0].told.nodes || {});
    for (const name of names) {
      for (let axis = 0; axis < (data.plane ? 2 : 3); axis++) {
        const of = (one) => one.told.nodes[name].position[axis], values = states.map(of);
        const spread = Math.max(...values) - Math.min(...values);
        if (spread > UNFELT * extent) found.push({ label: `${"xyz"[axis]} of ${name}, m`, of, values, spread });
      }
      const of = (one) => one.told.nodes[name].angle, values = states.map(of);
      if (values.every((value) => typeof value === "number") && Math.max(...values) - Math.min(...values) > UNFELT) found.push({ label: `angle of ${name}, rad`, of, values, spread: 0 });
    }
    const most = Math.max(...states.map((one) => (one.omega || []).length));
    const frequencies = Array.from({ length: most }, (_, k) => {
      const of = (one) => (one.omega ? one.omega[k] : NaN);
      return { label: `frequency ${k + 1}, rad/s`, of, values: states.map(of), spread: 0 };
    });
    return [...frequencies, ...found.sort((a, b) => b.spread - a.spread).slice(0, MOST_RECORDS)];
  };
  const known = states.length;
  const several = states.length > 2 && !data.modes.length && new Set(states.map((one) => one.at)).size > 2;
  const charted = several ? courses() : [];
  // Where nothing moves along a path there is still where it meets what.
  if (several && !charted.length && data.kind === "path") charted.push({ label: "number of the point", of: () => NaN, values: states.map((_, i) => i + 1), spread: 0 });
  let chart = null;

  const ticks = (low, high) => {
    const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((one) => one * power >= rough), found = [];
    for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k++) found.push(Number((k * step).toPrecision(12)));
    return found;
  };
  const drawChart = (holder, number) => {
    const course = charted[number], factor = { label: upright ? "time, s" : "load factor", values: states.slice(0, known).map((one) => one.at) };
    const [x, y] = upright ? [factor, course] : [course, factor];
    const W = 360, H = 240, edge = { left: 52, right: 10, top: 10, bottom: 36 };
    const NS = "http://www.w3.org/2000/svg", svg = document.createElementNS(NS, "svg");
    svg.setAttribute("viewBox", `0 0 ${W} ${H}`);
    const add = (tag, attributes, text) => {
      const found = document.createElementNS(NS, tag);
      for (const [key, value] of Object.entries(attributes)) found.setAttribute(key, value);
      if (text !== undefined) found.textContent = text;
      svg.append(found);
      return found;
    };
    const span = (values) => {
      const finite = values.filter(Number.isFinite), low = Math.min(...finite), high = Math.max(...finite), margin = 0.04 * (high - low) || Math.abs(high) || 1;
      return [low - margin, high + margin];
    };
    const [xs, ys] = [span(x.values), span(y.values)];
    const px = (value) => edge.left + ((value - xs[0]) / (xs[1] - xs[0])) * (W - edge.left - edge.right);
    const py = (value) => H - edge.bottom - ((value - ys[0]) / (ys[1] - ys[0])) * (H - edge.top - edge.bottom);
    const font = { "font-size": 10, fill: "#5b6672" };
    for (const tick of ticks(...xs)) {
      add("line", { x1: px(tick), x2: px(tick), y1: edge.top, y2: H - edge.bottom, stroke: "#e6e9ed" });
      add("text", { x: px(tick), y: H - edge.bottom + 12, "text-anchor": "middle", ...font }, String(tick));
    }
    for (const tick of ticks(...ys)) {
      add("line", { x1: edge.left, x2: W - edge.right, y1: py(tick), y2: py(tick), stroke: "#e6e9ed" });
      add("text", { x: edge.left - 4, y: py(tick) + 3, "text-anchor": "end", ...font }, String(tick));
    }
    add("text", { x: 0.5 * (edge.left + W - edge.right), y: H - 6, "text-anchor": "middle", ...font }, x.label);
    add("text", { x: 11, y: 0.5 * (edge.top + H - edge.bottom), "text-anchor": "middle", transform: `rotate(-90 11 ${0.5 * (edge.top + H - edge.bottom)})`, ...font }, y.label);
    const told = (i) => Number.isFinite(x.values[i]) && Number.isFinite(y.values[i]);
    // Between load steps nothing is known.
    const along = x.values.map((_, i) => i).filter((i) => data.kind !== "static" && !BESIDE.includes(states[i].kind));
    for (let k = 0; k + 1 < along.length; k++) {
      const [i, j] = [along[k], along[k + 1]];
      if (states[i].branch !== states[j].branch || !told(i) || !told(j)) continue;
      const unstable = states[j].stable === false || states[i].stable === false;
      const line = add("line", { x1: px(x.values[i]), y1: py(y.values[i]), x2: px(x.values[j]), y2: py(y.values[j]), stroke: INKS[states[i].branch % INKS.length], "stroke-width": 1.6, "stroke-linecap": "round" });
      if (unstable) line.setAttribute("stroke-dasharray", "3 3");
    }
    states.slice(0, known).forEach((one, i) => {
      if (!told(i)) return;
      const at = { stroke: INKS[one.branch % INKS.length], fill: "#fff", "stroke-width": 1.4 };
      const mark = one.kind === "bifurcation" ? add("rect", { x: px(x.values[i]) - 4, y: py(y.values[i]) - 4, width: 8, height: 8, ...at })
        : one.kind === "limit point" ? add("circle", { cx: px(x.values[i]), cy: py(y.values[i]), r: 4.2, ...at })
          : one.kind === "transition" ? add("path", { d: `M${px(x.values[i])},${py(y.values[i]) - 5}l5,5l-5,5l-5,-5z`, ...at })
          : one.kind === "flutter point" ? add("path", { d: `M${px(x.values[i])},${py(y.values[i]) - 5}l5,9h-10z`, ...at })
          : one.kind === "step" || data.kind === "static" ? add("circle", { cx: px(x.values[i]), cy: py(y.values[i]), r: 2.2, ...at }) : null;
      if (mark) mark.append(Object.assign(document.createElementNS(NS, "title"), { textContent: one.text }));
    });
    const cursor = add("circle", { r: 5.5, fill: "none", stroke: "#d03030", "stroke-width": 2, class: "cursor" });
    const follow = () => {
      const here = states[state], value = course.of(here), [cx, cy] = upright ? [here.at, value] : [value, here.at];
      const within = cx >= xs[0] && cx <= xs[1] && cy >= ys[0] && cy <= ys[1];
      const place = state < known ? (told(state) ? [x.values[state], y.values[state]] : null) : within ? [cx, cy] : null;
      cursor.setAttribute("visibility", place ? "visible" : "hidden");
      if (!place) return;
      cursor.setAttribute("cx", px(place[0]));
      cursor.setAttribute("cy", py(place[1]));
    };
    const nearest = (event) => {
      const frame = svg.getBoundingClientRect(), cx = ((event.clientX - frame.left) / frame.width) * W, cy = ((event.clientY - frame.top) / frame.height) * H;
      const off = x.values.map((_, i) => (!told(i) ? Infinity : upright ? Math.abs(px(x.values[i]) - cx) : Math.hypot(px(x.values[i]) - cx, py(y.values[i]) - cy)));
      return off.indexOf(Math.min(...off));
    };
    svg.addEventListener("pointerdown", (event) => {
      svg.setPointerCapture(event.pointerId);
      stop();
      go(nearest(event));
    });
    svg.addEventListener("pointermove", (event) => event.buttons && go(nearest(event)));
    holder.replaceChildren(svg);
    chart = { follow };
    follow();
  };

  // -- panels and player ----------------------------------------------------------------------------------------------

  const panels = [];
  const addPanel = (name, show) => {
    const button = made("button", name, $("tabs")), panel = made("div", undefined, $("panels"));
    panel.id = `panel-${name.toLowerCase()}`;
    button.id = `tab-${name.toLowerCase()}`;
    panels.push({ button, panel, show });
    button.addEventListener("click", () => open(name));
    return panel;
  };
  const open = (name) => {
    for (const one of panels) {
      const chosen = one.button.textContent === name;
      one.button.setAttribute("aria-selected", chosen);
      one.panel.hidden = !chosen;
      if (chosen && one.show) one.show(one.panel);
    }
  };
  const refresh = () => {
    for (const one of panels) if (!one.panel.hidden && one.show) one.show(one.panel);
    if (chart) chart.follow();
  };
  const go = (number) => {
    state = Math.min(Math.max(number, 0), states.length - 1);
    $("state").value = Math.min(state, known - 1);
    $("where").textContent = data.modes.length ? "" : `${states[state].text}${states[state].stable === false && states[state].kind !== "live" ? ", unstable" : ""}`;
    refresh();
    draw();
  };
  const stop = () => {
    playing = 0;
    $("play").textContent = "play";
  };
  const play = () => {
    const mine = (playing = performance.now()), from = state >= last ? 0 : shareOf(state);
    $("play").textContent = "stop";
    const begin = performance.now();
    const tick = (now) => {
      if (playing !== mine) return;
      const passed = (now - begin) / 1000;
      if (data.modes.length) {
        phase = 2 * Math.PI * 0.5 * passed;
        draw();
      } else {
        const number = at((passed / data.seconds + from) % 1);
        if (number !== state) go(number);
      }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  };
  // What was asked for beside a path stands after it and is not played.
  const last = states.reduce((found, one, i) => (BESIDE.includes(one.kind) ? found : i), 0);
  /** Which share of all that is played is over at a state: of a motion of its time. */
  const shareOf = (number) => (upright ? (states[number].at - states[0].at) / (states[last].at - states[0].at || 1) : number / (last + 1));
  const at = (share) => {
    let found = 0;
    while (found < last && shareOf(found + 1) <= share) found++;
    return found;
  };

  // -- pointers -------------------------------------------------------------------------------------------------------

  const pointers = new Map();
  let moved = 0;
  const within = (event) => {
    const frame = over.getBoundingClientRect();
    return [event.clientX - frame.left, event.clientY - frame.top];
  };
  let held = null;
  over.addEventListener("pointerdown", (event) => {
    over.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, within(event));
    moved = 0;
    held = live && state === known ? live.handleAt(...within(event)) : null;
  });
  over.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) {
      const handle = live && state === known && live.handleAt(...within(event));
      over.style.cursor = handle ? "move" : nearest(...within(event)) ? "pointer" : "grab";
      return;
    }
    const now = within(event), dx = now[0] - before[0], dy = now[1] - before[1];
    moved += Math.hypot(dx, dy);
    if (held) live.drag(held, dx, dy);
    else if (pointers.size === 2) {
      const other = [...pointers].find(([key]) => key !== event.pointerId)[1];
      const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]) || 1;
      zoom(apart(now) / apart(before), ...other);
      pan(0.5 * dx, 0.5 * dy);
    } else if (data.plane === (event.shiftKey || event.buttons !== 1)) turn(dx, dy);
    else pan(dx, dy);
    pointers.set(event.pointerId, now);
    draw();
  });
  const release = (event) => {
    if (pointers.delete(event.pointerId) && moved < 4 && event.type === "pointerup") pick(...within(event));
    held = null;
  };
  over.addEventListener("pointerup", release);
  over.addEventListener("pointercancel", release);
  over.addEventListener("contextmenu", (event) => event.preventDefault());
  over.addEventListener("dblclick", () => reset());
  over.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY), ...within(event));
    draw();
  }, { passive: false });

  /** The node, else the place on a member, that is nearest to a pixel; null where none is near. */
  const nearest = (x, y) => {
    let best = NEAR, found = null;
    const lines = drawn();
    for (let m = 0; m < members.length; m++) {
      for (let i = starts[m]; i < starts[m + 1]; i++) {
        const [px, py] = seen(lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]), off = Math.hypot(px - x, py - y);
        if (off < best) [best, found] = [off, { member: m, sample: i - starts[m] }];
      }
    }
    if (data.modes.length) return found;
    let near = NEAR;
    for (const [name, record] of Object.entries(nodesNow())) {
      const [px, py] = seen(...record.position), off = Math.hypot(px - x, py - y);
      // A node goes before the places beside it.
      if (off < near) [near, found] = [off, { node: name }];
    }
    return found;
  };
  const pick = (x, y) => {
    picked = nearest(x, y);
    open("Values");
    draw();
  };
  const reset = () => look([...data.view.right], [...data.view.up]);

  // -- the solver itself ----------------------------------------------------------------------------------------------

  /* On live pages the text of live.js stands here. */
  let code = null, lacking = "";
  if (data.live) {
    try {
      code = await compiled(data.live.module);
    } catch (error) {
      lacking = `The solver does not run in this browser (${error.message}): the page shows the answer without it.`;
    }
  }
  const live = code ? withSolver(data.live, code) : null;

  // -- begin ----------------------------------------------------------------------------------------------------------

  if (data.modes.length) $("show-rest").nextSibling.textContent = " equilibrium";
  $("title").textContent = data.title || "untitled scene";
  $("status").textContent = data.status;
  $("hint").textContent = data.plane ? "drag: move, Shift and drag: turn, wheel: zoom" : "drag: turn, Shift and drag: move, wheel: zoom";
  const option = (select, value, text) => (made("option", text, select).value = value);
  option($("colour"), "", "none");
  for (const one of data.modes.length ? [] : quantities) option($("colour"), one.key, one.label);
  $("colour").parentElement.hidden = data.modes.length > 0;
  $("colour").addEventListener("change", () => setColour($("colour").value));
  for (const [name, right, up] of [["x-y", [1, 0, 0], [0, 1, 0]], ["x-z", [1, 0, 0], [0, 0, 1]], ["y-z", [0, 1, 0], [0, 0, 1]]].slice(0, data.plane ? 0 : 3)) {
    const button = made("button", name, $("turns"));
    button.title = `look at the ${name} plane`;
    button.addEventListener("click", () => look(right, up));
  }
  $("fit").addEventListener("click", reset);
  for (const name of ["show-symbols", "show-labels", "show-rest"]) $(name).addEventListener("change", draw);
  $("show-labels").checked = data.kind === "static";

  if (charted.length) {
    // On a live page beside what moves it.
    const panel = live ? made("section", undefined, $("panel-live")) : addPanel("Chart"), choice = made("select", undefined, panel);
    const holder = made("div", undefined, panel);
    holder.className = "chart";
    choice.id = "quantity";
    charted.forEach((one, i) => option(choice, i, one.label));
    choice.addEventListener("change", () => drawChart(holder, Number(choice.value)));
    drawChart(holder, 0);
    const marks = data.kind === "path" ? "Solid: stable, dashed: unstable; circles: limit points, squares: bifurcations, triangles: flutter points, diamonds: where contact, stops or strings change, dots: factors asked for. " : "";
    made("p", `${marks}Click or drag: the structure follows.`, panel);
  }
  if (live) live.begin();
  if (lacking) made("p", lacking, addPanel("Live"));
  addPanel("Values", showValues);
  addPanel("Answer", showAnswer);
  made("pre", data.report, addPanel("Report"));
  made("pre", data.scene, addPanel("Scene"));
  open(data.live ? "Live" : charted.length ? "Chart" : "Report");
  if (live) state = known;

  $("state").max = known - 1;
  $("state").hidden = data.modes.length > 0;
  document.querySelector("footer").hidden = known < 2 && !live && !data.modes.length;
  $("state").addEventListener("input", () => {
    stop();
    go(Number($("state").value));
  });
  $("play").addEventListener("click", () => (playing ? stop() : play()));
  if (data.modes.length) {
    $("modes").hidden = false;
    data.modes.forEach((one, i) => option($("mode"), i, one.text));
    $("mode").addEventListener("change", () => {
      mode = Number($("mode").value);
      refresh();
      draw();
    });
    $("size").addEventListener("input", () => {
      amplitude = Number($("size").value) / 100;
      draw();
    });
  }
  new ResizeObserver(resize).observe($("stage"));
  resize();
  // What is zero everywhere needs no colours.
  const first = quantities.find((one) => range(one.key) && !nothing[one.key]);
  setColour(first && !data.modes.length ? first.key : "");
  $("colour").value = colour;
  go(state);
  if (data.modes.length) play();

  /** For scripts: where nodes and places are seen, in pixels of the window, where they are, m, and what is shown. */
  window.sfetcas = Object.freeze({
    at: (what) => [...placeOf(what, state)],
    symbols: () => states[state].symbols.map((one) => (typeof one === "object" ? one : data.symbols[one])),
    seen: (what) => {
      const [x, y] = seen(...placeOf(what, state)), frame = over.getBoundingClientRect();
      return [x + frame.left, y + frame.top];
    },
    state: () => state,
    picked: () => picked,
    webgl: Boolean(gl),
    fine: () => !coarse && !waiting,
    /** Of a live page: solve with these arguments, from the undeformed structure where `afresh`; status and results. */
    solve: (values, afresh = false) => {
      if (afresh) live.forget();
      const status = live.follow(values);
      go(known);
      return { status, results: [...live.results] };
    },
    /** Of a live motion: so many steps from its beginning, with these arguments or those of the scene; as above. */
    steps: (count, values = null) => {
      const status = live.steps(count, values);
      go(known);
      return { status, results: [...live.results] };
    },
    handles: () => (live ? live.handles.map((one) => ({ ...one, tip: live.tip(one)[1] })) : []),
  });
})();
