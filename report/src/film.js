// Plays the films of this page: each moving part has a place for every frame.
"use strict";
addEventListener("DOMContentLoaded", () => {
  for (const figure of document.querySelectorAll("figure.film")) {
    const film = JSON.parse(figure.querySelector("script").textContent, seen), { times } = film;
    const [button, slider, speed, clock] = ["button", "input", "select", "output"].map(tag => figure.querySelector(tag));
    const scenes = [...figure.querySelectorAll(".scene")].map((box, place) => ({
      ...film.scenes[place], words: box.querySelector(".state"), parts: [...box.querySelectorAll(".moving")],
    }));
    let frame = film.first, time = times[frame], last = 0, plays = false;

    function showPart(part, { frames, trail }) {
      const now = frames[frame], line = trail ? frames.slice(Math.max(0, frame - trail), frame + 1).flat() : now;
      part.querySelector("polyline").setAttribute("points", line.join(" "));
      part.querySelectorAll("circle").forEach((dot, k) => {
        dot.setAttribute("cx", now[2 * k]);
        dot.setAttribute("cy", now[2 * k + 1]);
      });
    }

    function show(wanted) {
      frame = wanted;
      slider.value = frame;
      clock.textContent = `${times[frame].toFixed(3)} s`;
      for (const { words, parts, moving, states, state } of scenes) {
        parts.forEach((part, place) => showPart(part, moving[place]));
        if (words) words.textContent = states[state[frame]];
      }
    }

    function step(now) {
      if (!plays) return;
      time += ((now - last) / 1000) * speed.value;
      last = now;
      if (time > times.at(-1)) time = times[0];
      let next = time < times[frame] ? 0 : frame;
      while (next + 1 < times.length && times[next + 1] <= time) next += 1;
      if (next !== frame) show(next);
      requestAnimationFrame(step);
    }

    function play(wanted) {
      plays = wanted;
      button.textContent = plays ? "Pause" : "Play";
      time = times[frame];
      last = performance.now();
      if (plays) requestAnimationFrame(step);
    }

    button.addEventListener("click", () => play(!plays));
    slider.addEventListener("input", () => {
      play(false);
      show(+slider.value);
    });
    addEventListener("beforeprint", () => play(false));
    figure.querySelector(".controls").hidden = false;
  }
});
