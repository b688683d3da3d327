"use strict";
// plays the particles in two views that turn together: what is drawn when, and what a hand does to it
(() => {
  const said = document.querySelector(".player-said"), root = document.querySelector(".player");
  const section = root.closest("section");
  const facts = JSON.parse(document.getElementById("player-facts").textContent);
  const { frames, particles: n, times, lowest, quantum, period, diameter } = facts;
  const find = (selector) => root.querySelector(selector);

  // colours from 0 to the end of the scale, even steps; also the bars below the views
  const RAMPS = {
    speed: ["#3b4cc0", "#2f8fbf", "#35b779", "#b5cf3a", "#fde04a"],
    error: ["#8d99a8", "#c9a24b", "#e8863a", "#d9442f", "#9c1560"],
    fluid: ["#2b1b4d", "#6a3491", "#b253ac", "#e48fb9", "#fbe3ee"],
  };
  const HOME = { turn: 0.6, tilt: 0.35, zoom: 1, x: 0, y: 0 };
  const LEAST = 0.5, MOST = 20; // of the zoom
  const RATE = 15; // frames a second

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

  const span = (value, unitText) => `${value.toPrecision(3)} ${unitText}`;
  const length = (metres) => (diameter ? span(metres / diameter, "d") : span(metres, "m"));
  const metresPerSecond = (value) => `${value.toPrecision(2)} m/s or more`;

  function start({ radii, series, outlines, slices }) {
    const [truth, ...predictions] = series;
    const room = around(truth), positions = new Float32Array(3 * n), levels = new Float32Array(n);
    const camera = { ...HOME };
    const colour = find("[name=player-colour]"), interval = find("[name=player-interval]");
    const plane = find("[name=player-fluid]"), scrub = find(".scrub"), play = find(".play");
    root.hidden = false;
    said.hidden = true;
    const canvases = [...root.querySelectorAll("canvas")];
    const views = canvases.map((canvas) => playerView.view(canvas, { radii, outlines }, room, facts));
    const moving = 12 * facts.bodies.filter((body) => body.moves).length;

    function draw() {
      const frame = Number(scrub.value), found = facts.predictions[interval.value];
      const shown = [truth, predictions[interval.value]], ramp = RAMPS[colour.value];
      const slow = colour.value === "speed", cut = slices[plane?.value]; // none: the whole of the beads
      const ink = getComputedStyle(root).color.match(/[\d.]+/g).slice(0, 3).map((part) => part / 255);
      const moves = outlines.moved?.subarray(frame * moving, (frame + 1) * moving);
      for (const [which, paint] of views.entries()) {
        if (slow) speeds(shown[which], frame, levels);
        else errors(truth, shown[1], frame, found.largest, levels);
        fill(shown[which], frame, positions);
        const bytes = cut?.levels(which && 1 + Number(interval.value), frame);
        const fluid = cut ? { plane: cut, bytes, ramp: RAMPS.fluid } : null;
        paint({ positions, levels, ramp, camera, moves, ink, fluid });
      }
      scale(".ramp", ramp, slow ? metresPerSecond(facts.fastest) : `${length(found.largest)} or more`);
      if (plane) scale(".fluid-ramp", RAMPS.fluid, metresPerSecond(facts.fluid.fastest));
      if (plane) find(".fluid-ramp").hidden = !cut;
      const own = cut ? facts.fluid.predictions[interval.value] : null;
      find(".named").textContent =
        `${found.surrogate}, ${found.modes} modes` + (own ? `; fluid: ${own.surrogate}, ${own.modes} modes` : "");
      const kind = found.kept[frame] ? "trained on" : "unseen";
      find(".moment").textContent =
        `t = ${(1e3 * times[frame]).toFixed(1)} ms, ${kind}, RMSE ${length(found.frame_rmse[frame])}`;
      section.dataset.frame = frame;
    }
    function scale(selector, ramp, end) {
      find(`${selector} i`).style.background = `linear-gradient(to right, ${ramp.join(", ")})`;
      find(`${selector} .end`).textContent = end;
    }

    let playing = 0, began = 0;
    function tick(now) {
      if (!playing) return;
      began ||= now - (Number(scrub.value) * 1e3) / RATE;
      const frame = Math.floor(((now - began) * RATE) / 1e3) % frames;
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
    function step(by) {
      set(false);
      scrub.value = Number(scrub.value) + by;
      draw();
    }
    play.addEventListener("click", () => set(!playing));
    scrub.addEventListener("input", () => step(0));
    for (const pick of [colour, interval, plane]) pick?.addEventListener("change", draw);
    root.addEventListener("keydown", (event) => {
      const { key, target } = event, by = { ArrowLeft: -1, ArrowRight: 1 }[key];
      if (target instanceof HTMLSelectElement || event.ctrlKey || event.altKey || event.metaKey) return;
      if (key === " " && target !== play) set(!playing); // a button knows its own key
      else if (by && target !== scrub) step(by); // a slider its own
      else return;
      event.preventDefault();
    });
    canvases.forEach((canvas) => playerHand(canvas, camera, { home: HOME, least: LEAST, most: MOST }, draw));
    new ResizeObserver(draw).observe(find(".stages"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    draw();
    section.dataset.player = "ready";
  }

  playerData.read(section, facts).then(start).catch((error) => {
    root.hidden = true;
    said.hidden = false;
    said.textContent = `The particles cannot be shown: ${error.message}.`;
    section.dataset.player = "failed";
  });
})();
