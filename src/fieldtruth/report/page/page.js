// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
// Labels over photographs, one time cursor for all curves and the map, and copying of code.
"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const { duration, curves, path, classes } = JSON.parse($("numbers").textContent);
  document.documentElement.classList.add("js");

  // Labels ----------------------------------------------------------------------------------------------------------
  const pairs = $("pairs");
  if (pairs) {
    const slider = $("tags-opacity");
    const show = () => {
      pairs.style.setProperty("--chosen", slider.value / 100);
      $("tags-value").textContent = `${slider.value} %`;
    };
    slider.addEventListener("input", () => {
      $("tags-on").checked = true;
      show();
    });
    show();

    const under = $("under");
    const hint = under.textContent;
    const pixels = new Map(); // by tag image, read when the pointer is first over it
    const read = (image) => {
      if (!pixels.has(image)) {
        const canvas = document.createElement("canvas");
        canvas.width = image.naturalWidth;
        canvas.height = image.naturalHeight;
        const context = canvas.getContext("2d", { willReadFrequently: true });
        context.drawImage(image, 0, 0);
        pixels.set(image, context.getImageData(0, 0, canvas.width, canvas.height));
      }
      return pixels.get(image);
    };
    pairs.addEventListener("pointermove", (event) => {
      const view = event.target.closest(".view");
      const image = view && view.querySelector(".tag");
      if (!image || !image.naturalWidth) return;
      const box = view.getBoundingClientRect();
      const { data, width, height } = read(image);
      const column = Math.min(width - 1, Math.max(0, Math.floor(((event.clientX - box.left) / box.width) * width)));
      const row = Math.min(height - 1, Math.max(0, Math.floor(((event.clientY - box.top) / box.height) * height)));
      const at = 4 * (row * width + column);
      const colour = "#" + [0, 1, 2].map((k) => data[at + k].toString(16).padStart(2, "0")).join("");
      const swatch = document.createElement("i");
      swatch.style.background = colour;
      under.replaceChildren(swatch, ` ${classes[colour] || "no class"}`);
    });
    pairs.addEventListener("pointerleave", () => under.replaceChildren(hint));
  }

  // Time ------------------------------------------------------------------------------------------------------------
  const nearest = (times, t) => {
    let low = 0;
    let high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle;
      else high = middle;
    }
    return t - times[low] <= times[high] - t ? low : high;
  };
  const time = $("time");
  const robot = $("robot");
  const figures = [...document.querySelectorAll(".curve")].map((figure) => ({
    channels: curves[figure.dataset.key],
    outputs: [...figure.querySelectorAll(".reading")],
  }));
  const moveRobot = (t) => {
    if (!robot || !path.length) return;
    const [, left, top] = path[nearest(path.map((row) => row[0]), t)];
    robot.style.left = `${left}%`;
    robot.style.top = `${top}%`;
  };
  const text = (value) => String(value).replace("-", "−");
  const setTime = (t) => {
    t = Math.min(duration, Math.max(0, t));
    time.value = t;
    $("time-value").textContent = `${(t / 1000).toFixed(2)} s`;
    $("curves").style.setProperty("--at", `${(100 * t) / Math.max(duration, 1e-9)}%`);
    $("curves").classList.add("timed");
    for (const { channels, outputs } of figures) {
      channels.forEach(([times, values], k) => (outputs[k].textContent = text(values[nearest(times, t)])));
    }
    moveRobot(t);
  };
  moveRobot(0);
  if (time) {
    time.addEventListener("input", () => setTime(Number(time.value)));
    const point = (event) => {
      const plot = event.target.closest(".plot");
      if (!plot) return;
      const box = plot.getBoundingClientRect();
      setTime((duration * (event.clientX - box.left)) / box.width);
    };
    $("curves").addEventListener("pointermove", point);
    $("curves").addEventListener("pointerdown", point);
    for (const instant of document.querySelectorAll('input[name="pair"]')) {
      instant.addEventListener("change", () => setTime(Number(instant.dataset.ms)));
    }
  }

  // Copying -----------------------------------------------------------------------------------------------------------
  const copy = async (code) => {
    try {
      await navigator.clipboard.writeText(code.textContent);
    } catch {
      getSelection().selectAllChildren(code);
      document.execCommand("copy");
    }
  };
  for (const button of document.querySelectorAll(".copy")) {
    button.hidden = false;
    button.addEventListener("click", async () => {
      await copy(button.closest(".snippet").querySelector("code"));
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
  }
})();
