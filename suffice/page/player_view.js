"use strict";
// draws beads as spheres, the fluid on a plane and the lines of walls into a canvas
const playerView = (() => {
  const FIELD = 0.27; // tangent of half the angle of view, at zoom 1
  const CLEAR = 0.5, FAINT = 0.25; // lines, and what is seen of them through what stands before them

  const PLACED = `#version 300 es
  uniform mat3 turned; uniform vec3 middle; uniform float away, field, aspect; uniform vec2 shift;
  vec3 seen(vec3 place) { return turned * (place - middle) - vec3(0.0, 0.0, away); }
  vec4 projected(vec3 p) {
    return vec4((p.x / field - shift.x * p.z) / aspect, p.y / field - shift.y * p.z, 0.0, -p.z);
  }`;
  const DEEP = `#version 300 es
  precision highp float;
  uniform float away, reach; uniform vec3 ramp[5];
  float depth(float z) { return clamp((-z - away + reach) / (2.0 * reach), 0.0, 0.9999); }
  vec3 shaded(float level) {
    float at = clamp(level, 0.0, 1.0) * 4.0;
    int low = min(int(at), 3);
    return mix(ramp[low], ramp[low + 1], at - float(low));
  }`;
  const BEADS = [`${PLACED}
  in vec3 place; in float radius; in float level;
  uniform float height; uniform vec4 cut;
  out vec3 centre; out float r; out float shade;
  void main() {
    centre = seen(place);
    r = radius; shade = level;
    float z = -centre.z;
    gl_Position = projected(centre);
    if (dot(cut.xyz, place) > cut.w) gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // before the plane: not drawn
    // a square around the sphere's outline, wider away from the middle of the view
    gl_PointSize = 1.1 * r * height / field / sqrt(max(z * z - r * r, 1e-30)) * length(centre) / z + 2.0;
  }`, `${DEEP}
  in vec3 centre; in float r; in float shade;
  uniform float field, height, aspect; uniform vec2 shift;
  out vec4 colour;
  void main() {
    // the ray through this pixel meets the sphere, or the pixel stays as it is
    vec2 at = gl_FragCoord.xy / height * 2.0 - vec2(aspect, 1.0) - shift;
    vec3 ray = normalize(vec3(at * field, -1.0));
    float along = dot(ray, centre), inside = along * along - dot(centre, centre) + r * r;
    if (inside < 0.0) discard;
    vec3 point = ray * (along - sqrt(inside)), normal = (point - centre) / r;
    gl_FragDepth = depth(point.z);
    float light = 0.38 + 0.62 * max(dot(normal, normalize(vec3(-0.4, 0.6, 0.8))), 0.0);
    colour = vec4(shaded(shade) * light, 1.0);
  }`];
  const SLICE = [`${PLACED}
  uniform vec3 corner, along, across;
  out vec2 share; out vec3 point;
  void main() {
    share = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    point = seen(corner + share.x * along + share.y * across);
    gl_Position = projected(point);
  }`, `${DEEP}
  in vec2 share; in vec3 point;
  uniform sampler2D speed, open;
  out vec4 colour;
  void main() {
    if (texture(open, share).r < 0.5) discard; // within a wall
    gl_FragDepth = depth(point.z);
    colour = vec4(shaded(texture(speed, share).r), 1.0);
  }`];
  const LINES = [`${PLACED}
  in vec3 place;
  uniform mat3 turn; uniform vec3 moved;
  out vec3 point;
  void main() { point = seen(turn * place + moved); gl_Position = projected(point); }`, `${DEEP}
  in vec3 point;
  uniform vec4 ink;
  out vec4 colour;
  void main() { gl_FragDepth = depth(point.z); colour = ink; }`];

  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((x) => x / Math.hypot(...a));
  const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);

  // rows: right, up and towards the eye; `up` of the scene stays upright
  function rotation(camera, up) {
    const side = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0])), front = cross(side, up);
    const [c, s, ct, st] = [Math.cos(camera.turn), Math.sin(camera.turn), Math.cos(camera.tilt), Math.sin(camera.tilt)];
    const flat = side.map((x, k) => c * x + s * front[k]);
    const eye = flat.map((x, k) => ct * x + st * up[k]);
    const right = unit(cross(up, flat));
    return { right, top: cross(eye, right), eye };
  }

  function program(gl, [vertex, fragment]) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error("the shaders of the player do not link");
    const places = {};
    return { made, at: (name) => (places[name] ??= gl.getUniformLocation(made, name)) };
  }

  // an array of vertices with its attributes, by name: how many numbers each has
  function vertices(gl, { made }, sizes) {
    const array = gl.createVertexArray(), buffers = {};
    gl.bindVertexArray(array);
    for (const [name, size] of Object.entries(sizes)) {
      const where = gl.getAttribLocation(made, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name] = gl.createBuffer());
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, size, gl.FLOAT, false, 0, 0);
    }
    const send = (name, values, use) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, values, use);
    };
    return { array, send };
  }

  // bytes (height, width) as a texture, read between their middles
  function texture(gl, unitNumber) {
    gl.activeTexture(gl.TEXTURE0 + unitNumber);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    for (const size of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, size, gl.LINEAR);
    return ([height, width], bytes) => {
      gl.activeTexture(gl.TEXTURE0 + unitNumber);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, width, height, 0, gl.RED, gl.UNSIGNED_BYTE, bytes);
    };
  }

  // returns draw({ positions, levels, ramp, camera, moves, ink, fluid }); fluid: { plane, bytes, ramp } or null
  function view(canvas, { radii, outlines }, { middle, reach }, facts) {
    // what was drawn stays, so that the picture can be copied
    const gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2, or it is switched off");
    const [beads, slice, lines] = [BEADS, SLICE, LINES].map((texts) => program(gl, texts));
    const balls = vertices(gl, beads, { place: 3, radius: 1, level: 1 }), ends = vertices(gl, lines, { place: 3 });
    balls.send("radius", radii, gl.STATIC_DRAW);
    ends.send("place", outlines.ends, gl.STATIC_DRAW);
    const [speed, open] = [texture(gl, 0), texture(gl, 1)];
    const ball = reach + radii.reduce((a, b) => Math.max(a, b), 0), away = 1.02 * ball * Math.hypot(1, 1 / FIELD);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);

    function use({ made, at }, camera, axes, ramp) {
      gl.useProgram(made);
      // column by column
      const turned = [0, 1, 2].flatMap((k) => [axes.right[k], axes.top[k], axes.eye[k]]);
      gl.uniformMatrix3fv(at("turned"), false, turned);
      gl.uniform3fv(at("middle"), middle);
      gl.uniform1f(at("away"), away);
      gl.uniform1f(at("reach"), 2 * ball);
      gl.uniform1f(at("field"), FIELD / camera.zoom);
      gl.uniform2f(at("shift"), camera.x, camera.y);
      gl.uniform1f(at("height"), canvas.height);
      gl.uniform1f(at("aspect"), canvas.width / canvas.height);
      gl.uniform3fv(at("ramp"), ramp.flatMap(rgb));
    }

    // the half space before the plane, seen from the eye: (normal, distance from the origin)
    function half(plane, eye) {
      const k = "xyz".indexOf(plane.across), side = Math.sign(middle[k] + away * eye[k] - plane.at) || 1;
      return [0, 1, 2].map((axis) => (axis === k ? side : 0)).concat(side * plane.at);
    }

    function drawLines(strength, moves, ink) {
      let first = 0, moving = 0;
      gl.uniform4fv(lines.at("ink"), [...ink.map((x) => x * strength), strength]);
      for (const body of facts.bodies) {
        const m = body.moves ? moves.subarray(12 * moving, 12 * ++moving) : [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
        gl.uniformMatrix3fv(lines.at("turn"), false, [0, 1, 2].flatMap((k) => [m[k], m[4 + k], m[8 + k]]));
        gl.uniform3f(lines.at("moved"), m[3], m[7], m[11]);
        gl.drawArrays(gl.LINES, first, body.ends);
        first += body.ends;
      }
    }

    return ({ positions, levels, ramp, camera, moves, ink, fluid }) => {
      const fine = Math.min(devicePixelRatio || 1, 2), axes = rotation(camera, facts.up);
      const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(Math.round(fine * x), 1));
      if (canvas.width !== width) canvas.width = width;
      if (canvas.height !== height) canvas.height = height;
      gl.viewport(0, 0, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); // transparent: the page's own ground
      use(beads, camera, axes, ramp);
      gl.uniform4fv(beads.at("cut"), fluid ? half(fluid.plane, axes.eye) : [0, 0, 0, 1]);
      balls.send("place", positions, gl.DYNAMIC_DRAW);
      balls.send("level", levels, gl.DYNAMIC_DRAW);
      gl.bindVertexArray(balls.array);
      gl.drawArrays(gl.POINTS, 0, radii.length);
      if (fluid) {
        const { plane } = fluid;
        use(slice, camera, axes, fluid.ramp);
        speed(plane.shape, fluid.bytes);
        open(plane.shape, plane.open);
        gl.uniform1i(slice.at("open"), 1);
        gl.uniform3fv(slice.at("corner"), plane.corner);
        gl.uniform3fv(slice.at("along"), plane.edges[0]);
        gl.uniform3fv(slice.at("across"), plane.edges[1]);
        gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
      }
      use(lines, camera, axes, ramp);
      gl.bindVertexArray(ends.array);
      gl.enable(gl.BLEND);
      drawLines(CLEAR, moves, ink);
      gl.disable(gl.DEPTH_TEST);
      drawLines(FAINT, moves, ink);
      gl.enable(gl.DEPTH_TEST);
      gl.disable(gl.BLEND);
    };
  }

  return { view };
})();
