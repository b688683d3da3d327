"use strict";
// plays the particles: unpacks the frames in the page, draws each bead as a sphere, in two views that turn together
(() => {
  const said = document.querySelector(".player-said"), root = document.querySelector(".player");
  const section = root.closest("section");
  const facts = JSON.parse(document.getElementById("player-facts").textContent);
  const { frames, particles: n, times, lowest, quantum, period, diameter } = facts;
  const find = (selector) => root.querySelector(selector);

  // colours from 0 to the end of the scale, even steps; also the bar below the views
  const RAMPS = {
    speed: ["#3b4cc0", "#2f8fbf", "#35b779", "#b5cf3a", "#fde04a"],
    error: ["#8d99a8", "#c9a24b", "#e8863a", "#d9442f", "#9c1560"],
  };
  const FIELD = 0.27; // tangent of half the angle of view
  const HOME = { turn: 0.6, tilt: 0.35 };
  const SECONDS = 8; // that all frames play

  const VERTEX = `#version 300 es
  in vec3 place; in float radius; in float level;
  uniform mat3 turned; uniform vec3 middle; uniform float away, field, height, aspect;
  out vec3 centre; out float r; out float shade;
  void main() {
    centre = turned * (place - middle) - vec3(0.0, 0.0, away);
    r = radius; shade = level;
    float z = -centre.z;
    gl_Position = vec4(centre.x / field / aspect, centre.y / field, 0.0, z);
    // a square around the sphere's outline, wider away from the middle of the view
    gl_PointSize = 1.1 * r * height / field / sqrt(max(z * z - r * r, 1e-30)) * length(centre) / z + 2.0;
  }`;
  const FRAGMENT = `#version 300 es
  precision highp float;
  in vec3 centre; in float r; in float shade;
  uniform float away, field, height, aspect, reach; uniform vec3 ramp[5];
  out vec4 colour;
  void main() {
    // the ray through this pixel meets the sphere, or the pixel stays as it is
    vec3 ray = normalize(vec3((gl_FragCoord.xy / height * 2.0 - vec2(aspect, 1.0)) * field, -1.0));
    float along = dot(ray, centre), inside = along * along - dot(centre, centre) + r * r;
    if (inside < 0.0) discard;
    vec3 point = ray * (along - sqrt(inside)), normal = (point - centre) / r;
    gl_FragDepth = clamp((-point.z - away + reach) / (2.0 * reach), 0.0, 1.0);
    float at = clamp(shade, 0.0, 1.0) * 4.0;
    int low = min(int(at), 3);
    vec3 own = mix(ramp[low], ramp[low + 1], at - float(low));
    float light = 0.38 + 0.62 * max(dot(normal, normalize(vec3(-0.4, 0.6, 0.8))), 0.0);
    colour = vec4(own * light, 1.0);
  }`;

  async function inflated(name) {
    const element = section.querySelector(`.player-stream[data-name="${name}"]`);
    const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
    element.remove(); // megabytes of text
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  // places (frames, 3, n): undoes what suffice/frames.py `pack` does
  async function places(name) {
    const bytes = new Uint8Array(await inflated(name)), size = frames * 3 * n, step = 3 * n;
    const out = new Uint16Array(size);
    for (let i = 0; i < size; i++) {
      const folded = bytes[i] | (bytes[size + i] << 8);
      out[i] = (folded >> 1) ^ -(folded & 1);
    }
    for (let order = 0; order < 2; order++) for (let i = step; i < size; i++) out[i] += out[i - step];
    return out;
  }

  const at = (series, frame, axis, i) => lowest[axis] + quantum * series[(frame * 3 + axis) * n + i];

  function distance(one, frameOne, other, frameOther, i) {
    let sum = 0;
    for (let axis = 0; axis < 3; axis++) {
      const step = (3 * frameOne + axis) * n + i, back = (3 * frameOther + axis) * n + i;
      sum += (one[step] - other[back]) ** 2;
    }
    return quantum * Math.sqrt(sum);
  }

  // m/s between the frames before and after
  function speeds(series, frame, levels) {
    const before = Math.max(frame - 1, 0), after = Math.min(frame + 1, frames - 1);
    const scale = 1 / ((times[after] - times[before]) * facts.fastest || Infinity);
    for (let i = 0; i < n; i++) levels[i] = distance(series, after, series, before, i) * scale;
  }

  function errors(truth, series, frame, end, levels) {
    for (let i = 0; i < n; i++) levels[i] = distance(truth, frame, series, frame, i) / (end || Infinity);
  }

  // what repeats is drawn in its box
  function fill(series, frame, out) {
    for (let axis = 0; axis < 3; axis++) {
      const [low, length] = period ? [period[0][axis], period[1][axis]] : [0, 0];
      for (let i = 0; i < n; i++) {
        const x = at(series, frame, axis, i);
        out[3 * i + axis] = length > 0 ? x - length * Math.floor((x - low) / length) : x;
      }
    }
  }

  // the ball in which the beads are, as every tenth frame has it
  function around(series) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const out = new Float32Array(3 * n);
    const each = (visit) => {
      for (let frame = 0; frame < frames; frame += 10) {
        fill(series, frame, out);
        for (let i = 0; i < n; i++) visit([out[3 * i], out[3 * i + 1], out[3 * i + 2]]);
      }
    };
    each((place) => place.forEach((x, k) => {
      low[k] = Math.min(low[k], x);
      high[k] = Math.max(high[k], x);
    }));
    const middle = low.map((x, k) => (x + high[k]) / 2);
    let reach = 0;
    each((place) => { reach = Math.max(reach, Math.hypot(...place.map((x, k) => x - middle[k]))); });
    return { middle, reach };
  }

  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((x) => x / Math.hypot(...a));

  // rows: right, up and towards the eye; `up` of the scene stays upright
  function rotation(camera) {
    const up = facts.up;
    const side = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0])), front = cross(side, up);
    const [c, s, ct, st] = [Math.cos(camera.turn), Math.sin(camera.turn), Math.cos(camera.tilt), Math.sin(camera.tilt)];
    const flat = side.map((x, k) => c * x + s * front[k]);
    const eye = flat.map((x, k) => ct * x + st * up[k]);
    const right = unit(cross(up, flat)), top = cross(eye, right);
    return [0, 1, 2].flatMap((k) => [right[k], top[k], eye[k]]); // column by column
  }

  const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);

  function program(gl) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error("the shaders of the player do not link");
    return made;
  }

  // a canvas that draws beads: returns draw(positions, levels, ramp, camera)
  function view(canvas, radii, { middle, reach }) {
    // what was drawn stays, so that the picture can be copied
    const gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2, or it is switched off");
    const made = program(gl), spot = (name) => gl.getUniformLocation(made, name);
    const buffers = {};
    gl.useProgram(made);
    for (const [name, size] of [["place", 3], ["radius", 1], ["level", 1]]) {
      const where = gl.getAttribLocation(made, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name] = gl.createBuffer());
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, size, gl.FLOAT, false, 0, 0);
    }
    const send = (name, values, use) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, values, use);
    };
    send("radius", radii, gl.STATIC_DRAW);
    const ball = reach + radii.reduce((a, b) => Math.max(a, b), 0), away = 1.02 * ball * Math.hypot(1, 1 / FIELD);
    gl.uniform3fv(spot("middle"), middle);
    gl.uniform1f(spot("away"), away);
    gl.uniform1f(spot("reach"), ball);
    gl.uniform1f(spot("field"), FIELD);
    gl.enable(gl.DEPTH_TEST);
    return (positions, levels, ramp, camera) => {
      const fine = Math.min(devicePixelRatio || 1, 2);
      const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(Math.round(fine * x), 1));
      if (canvas.width !== width) canvas.width = width;
      if (canvas.height !== height) canvas.height = height;
      gl.viewport(0, 0, width, height);
      gl.uniform1f(spot("height"), height);
      gl.uniform1f(spot("aspect"), width / height);
      gl.uniformMatrix3fv(spot("turned"), false, rotation(camera));
      gl.uniform3fv(spot("ramp"), ramp.flatMap(rgb));
      send("place", positions, gl.DYNAMIC_DRAW);
      send("level", levels, gl.DYNAMIC_DRAW);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); // transparent: the page's own ground
      gl.drawArrays(gl.POINTS, 0, n);
    };
  }

  const span = (value, unitText) => `${value.toPrecision(3)} ${unitText}`;
  const length = (metres) => (diameter ? span(metres / diameter, "d") : span(metres, "m"));

  function start(truth, predictions, radii) {
    const room = around(truth), positions = new Float32Array(3 * n), levels = new Float32Array(n);
    const camera = { ...HOME };
    const colour = find("[name=player-colour]"), interval = find("[name=player-interval]");
    const scrub = find(".scrub"), play = find(".play");
    root.hidden = false;
    said.hidden = true;
    const [left, right] = [...root.querySelectorAll("canvas")].map((canvas) => view(canvas, radii, room));

    function draw() {
      const frame = Number(scrub.value), found = facts.predictions[interval.value];
      const series = predictions[interval.value], ramp = RAMPS[colour.value];
      const slow = colour.value === "speed";
      for (const [drawn, paint] of [[truth, left], [series, right]]) {
        if (slow) speeds(drawn, frame, levels);
        else errors(truth, series, frame, found.largest, levels);
        fill(drawn, frame, positions);
        paint(positions, levels, ramp, camera);
      }
      find(".named").textContent = `${found.surrogate}, ${found.modes} modes`;
      find(".ramp i").style.background = `linear-gradient(to right, ${ramp.join(", ")})`;
      find(".ramp .end").textContent = slow ? `${facts.fastest.toPrecision(2)} m/s or more` : `${length(found.largest)} or more`;
      const kind = found.kept[frame] ? "trained on" : "unseen";
      find(".moment").textContent =
        `t = ${(1e3 * times[frame]).toFixed(1)} ms, ${kind}, RMSE ${length(found.frame_rmse[frame])}`;
      section.dataset.frame = frame;
    }

    let playing = 0, began = 0;
    function tick(now) {
      if (!playing) return;
      began ||= now - (Number(scrub.value) * SECONDS * 1e3) / frames;
      const frame = Math.floor(((now - began) * frames) / (SECONDS * 1e3)) % frames;
      if (frame !== Number(scrub.value)) {
        scrub.value = frame;
        draw();
      }
      playing = requestAnimationFrame(tick);
    }
    function set(on) {
      cancelAnimationFrame(playing);
      began = 0;
      play.textContent = on ? "Pause" : "Play";
      playing = on ? requestAnimationFrame(tick) : 0;
    }
    play.addEventListener("click", () => set(!playing));
    scrub.addEventListener("input", () => { set(false); draw(); });
    for (const pick of [colour, interval]) pick.addEventListener("change", draw);
    for (const canvas of root.querySelectorAll("canvas")) {
      let held = null; // where the finger or the mouse was last
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        held = event;
      });
      for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
      canvas.addEventListener("pointermove", (event) => {
        if (held?.pointerId !== event.pointerId) return;
        camera.turn -= ((event.clientX - held.clientX) * Math.PI) / canvas.clientWidth;
        camera.tilt += ((event.clientY - held.clientY) * Math.PI) / canvas.clientWidth;
        held = event;
        camera.tilt = Math.min(Math.max(camera.tilt, -1.5), 1.5); // at the poles there is no upright
        draw();
      });
      canvas.addEventListener("dblclick", () => { Object.assign(camera, HOME); draw(); });
    }
    new ResizeObserver(draw).observe(find(".stages"));
    draw();
    section.dataset.player = "ready";
  }

  async function unpack() {
    if (typeof DecompressionStream === "undefined") {
      throw new Error("this browser cannot inflate them (no DecompressionStream); one of 2023 or later can");
    }
    const radii = new Float32Array(await inflated("radius"));
    const truth = await places("truth"), predictions = [];
    for (const i of facts.predictions.keys()) predictions.push(await places(i));
    start(truth, predictions, radii);
  }

  unpack().catch((error) => {
    root.hidden = true;
    said.hidden = false;
    said.textContent = `The particles cannot be shown: ${error.message}.`;
    section.dataset.player = "failed";
  });
})();
