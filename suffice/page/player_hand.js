"use strict";
// what mouse and fingers do to the camera of a canvas: drag turns, wheel and pinch zoom, double click or tap resets
const playerHand = (() => {
  const WHEEL = 0.0015, LINE = 20; // zoom per pixel of a wheel, pixels per line of one that counts lines
  const TWICE = 350, STILL = 6; // ms between two taps, pixels that a tap may move
  let scrolled = -Infinity; // when the wheel last moved the page

  return (canvas, camera, { home, least, most }, draw) => {
    const held = new Map(); // fingers, or the mouse, by their number: where each was last
    let tapped = -Infinity, went = 0;

    // in half heights of the canvas from its middle, upwards
    function spot(x, y) {
      const box = canvas.getBoundingClientRect();
      return [x - box.left - box.width / 2, box.top + box.height / 2 - y].map((part) => (2 * part) / box.height);
    }

    // what lies at (x, y) stays there
    function zoom(factor, [x, y]) {
      const next = Math.min(Math.max(camera.zoom * factor, least), most), by = next / camera.zoom;
      Object.assign(camera, { zoom: next, x: x - (x - camera.x) * by, y: y - (y - camera.y) * by });
    }

    function turn(from, to) {
      camera.turn -= ((to.clientX - from.clientX) * Math.PI) / canvas.clientWidth / camera.zoom;
      camera.tilt += ((to.clientY - from.clientY) * Math.PI) / canvas.clientWidth / camera.zoom;
      camera.tilt = Math.min(Math.max(camera.tilt, -1.5), 1.5); // at the poles there is no upright
    }

    // two fingers: what lies between them stays between them
    function pinch(before, after) {
      const middle = ([a, b]) => spot((a.clientX + b.clientX) / 2, (a.clientY + b.clientY) / 2);
      const apart = ([a, b]) => Math.max(Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY), 1);
      const [from, to] = [middle(before), middle(after)];
      zoom(apart(after) / apart(before), from);
      camera.x += to[0] - from[0];
      camera.y += to[1] - from[1];
    }

    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, event);
      went = held.size > 1 ? Infinity : 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = held.get(event.pointerId);
      if (!last || held.size > 2) return;
      const before = [...held.values()];
      held.set(event.pointerId, event);
      went += Math.hypot(event.clientX - last.clientX, event.clientY - last.clientY);
      if (before.length === 2) pinch(before, [...held.values()]);
      else turn(last, event);
      draw();
    });
    canvas.addEventListener("pointercancel", (event) => held.delete(event.pointerId));
    canvas.addEventListener("pointerup", (event) => {
      held.delete(event.pointerId);
      if (went > STILL) return;
      const twice = event.timeStamp - tapped < TWICE;
      tapped = twice ? -Infinity : event.timeStamp;
      if (twice) {
        Object.assign(camera, home);
        draw();
      }
    });
    // a page that is being scrolled past the canvas goes on scrolling, and so it does at the end of the zoom
    canvas.addEventListener("wheel", (event) => {
      const amount = event.deltaY * (event.deltaMode ? LINE : 1);
      const ended = camera.zoom === (amount > 0 ? least : most);
      if (ended || event.timeStamp - scrolled < TWICE) return;
      event.preventDefault();
      event.stopPropagation();
      zoom(Math.exp(-WHEEL * amount), spot(event.clientX, event.clientY));
      draw();
    }, { passive: false });
    addEventListener("wheel", (event) => { scrolled = event.timeStamp; }, { passive: true });
  };
})();
