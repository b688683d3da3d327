"use strict";
// the frames of the player, as suffice/player.py has packed them into the page
const playerData = (() => {
  async function inflated(section, name) {
    const element = section.querySelector(`.player-stream[data-name="${name}"]`);
    const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
    element.remove(); // megabytes of text
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  // whole numbers (frames, …), `step` of them a frame: undoes what suffice/frames.py `pack` does
  async function unpacked(section, name, step) {
    const bytes = new Uint8Array(await inflated(section, name)), size = bytes.length / 2;
    const out = new Uint16Array(size);
    for (let i = 0; i < size; i++) {
      const folded = bytes[i] | (bytes[size + i] << 8);
      out[i] = (folded >> 1) ^ -(folded & 1);
    }
    for (let order = 0; order < 2; order++) for (let i = step; i < size; i++) out[i] += out[i - step];
    return out;
  }

  async function planes(section, fluid) {
    const found = [];
    for (const [p, plane] of (fluid?.planes || []).entries()) {
      const size = plane.shape[0] * plane.shape[1], series = [];
      for (const name of ["truth", ...fluid.predictions.keys()]) {
        series.push(Uint8Array.from(await unpacked(section, `slice_${p}_${name}`, size)));
      }
      const open = new Uint8Array(await inflated(section, `open_${p}`));
      // of a frame, simulated (0) or predicted (1, 2 …)
      const levels = (which, frame) => series[which].subarray(frame * size, (frame + 1) * size);
      found.push({ ...plane, open, levels });
    }
    return found;
  }

  async function bodies(section, facts) {
    if (!facts.bodies.length) return { ends: new Float32Array(0), moved: null };
    const ends = new Float32Array(await inflated(section, "lines"));
    return { ends, moved: new Float32Array(await inflated(section, "moved")) };
  }

  async function read(section, facts) {
    if (typeof DecompressionStream === "undefined") {
      throw new Error("this browser cannot inflate them (no DecompressionStream); one of 2023 or later can");
    }
    const radii = new Float32Array(await inflated(section, "radius")), step = 3 * facts.particles;
    const series = []; // simulated, then predicted
    for (const name of ["truth", ...facts.predictions.keys()]) series.push(await unpacked(section, name, step));
    const [outlines, slices] = [await bodies(section, facts), await planes(section, facts.fluid)];
    return { radii, series, outlines, slices };
  }

  return { read };
})();
