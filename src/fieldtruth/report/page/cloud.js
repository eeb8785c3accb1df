// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
// An interactive labelled cloud. Points are drawn as discs and shaded by eye-dome lighting.
"use strict";
(() => {
  const canvas = document.getElementById("canvas");
  const gl = canvas && canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
  if (!gl) return; // the poster remains
  const settings = JSON.parse(document.getElementById("cloud-settings").textContent);
  const RADIANS = Math.PI / 180;
  const BACKGROUND = [30 / 255, 35 / 255, 43 / 255];
  const PATH = [74 / 255, 163 / 255, 1];

  const POINTS = `#version 300 es
    in vec3 steps;
    in float label;
    uniform mat4 clip_from_steps;
    uniform vec4 colours[${settings.colours.length + 1}]; // the last is 0 where the class is hidden
    uniform int byHeight, path;
    uniform float step_m, middle_z, low, high, size_px, smallest;
    out vec3 colour;
    vec3 ramp(float t) {
      vec3 a[5] = vec3[5](vec3(.267,.005,.329), vec3(.231,.322,.545), vec3(.129,.569,.549), vec3(.369,.788,.384), vec3(.992,.906,.145));
      float at = clamp(t, 0., .9999) * 4.;
      int k = int(at);
      return mix(a[k], a[k + 1], at - float(k));
    }
    void main() {
      int id = int(label);
      gl_Position = clip_from_steps * vec4(steps, 1.);
      bool isPath = id == path;
      gl_PointSize = clamp((isPath ? 2.5 : 1.) * size_px / gl_Position.w, isPath ? 2. * smallest : smallest, 16. * smallest);
      if (colours[id].a == 0.) gl_Position = vec4(2., 2., 2., 1.);
      colour = byHeight == 1 && !isPath ? ramp((steps.z * step_m + middle_z - low) / (high - low)) : colours[id].rgb;
    }`;
  const DISC = `#version 300 es
    precision mediump float;
    in vec3 colour;
    out vec4 pixel;
    void main() {
      vec2 offset = gl_PointCoord - .5;
      if (dot(offset, offset) > .25) discard;
      pixel = vec4(colour, 1.);
    }`;
  const TRIANGLE = `#version 300 es
    void main() { gl_Position = vec4(vec2[3](vec2(-1, -1), vec2(3, -1), vec2(-1, 3))[gl_VertexID], 0., 1.); }`;
  const SHADE = `#version 300 es
    precision highp float;
    precision highp sampler2D;
    uniform sampler2D image, depth;
    uniform float near, far, thick;
    uniform int radius;
    out vec4 pixel;
    float metres(ivec2 at) {
      float d = texelFetch(depth, clamp(at, ivec2(0), textureSize(depth, 0) - 1), 0).r;
      return d == 1. ? 1e6 : near * far / (far - d * (far - near));
    }
    void main() {
      ivec2 at = ivec2(gl_FragCoord.xy);
      vec3 colour = texelFetch(image, at, 0).rgb;
      if (texelFetch(depth, at, 0).r < 1.) {
        float here = metres(at), rise = 0.;
        for (int ring = 1; ring < 4; ring += 2) for (int i = -1; i < 2; i++) for (int j = -1; j < 2; j++)
          rise += clamp((here - metres(at + ring * radius * ivec2(i, j))) / thick, 0., 1.);
        colour *= .2 + .8 * exp(-.22 * rise);
      }
      pixel = vec4(colour, 1.);
    }`;

  const program = (vertex, fragment) => {
    const made = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    const uniforms = {};
    for (let k = 0; k < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); k++) {
      const name = gl.getActiveUniform(made, k).name.replace("[0]", "");
      uniforms[name] = gl.getUniformLocation(made, name);
    }
    return { made, uniforms };
  };
  const points = program(POINTS, DISC);
  const shade = program(TRIANGLE, SHADE);

  // The cloud ---------------------------------------------------------------------------------------------------------
  const text = atob(document.getElementById("cloud-data").textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  const cloud = gl.createVertexArray();
  gl.bindVertexArray(cloud);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STATIC_DRAW);
  const attribute = (name, ...form) => {
    const index = gl.getAttribLocation(points.made, name);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, ...form);
  };
  attribute("steps", 3, gl.SHORT, false, 6, 0);
  attribute("label", 1, gl.UNSIGNED_BYTE, false, 1, 6 * settings.count);
  const empty = gl.createVertexArray();
  const colours = new Float32Array([
    ...settings.colours.flatMap((colour) => [...[1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16) / 255), 1]),
    ...PATH, 1,
  ]);

  // Framebuffer of the points, before shading -------------------------------------------------------------------------
  const frame = gl.createFramebuffer();
  const [image, depth] = [gl.createTexture(), gl.createTexture()];
  const resize = () => {
    const ratio = 2; // on every screen: downscaling by the browser smooths the discs
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width === width && canvas.height === height && canvas.dataset.ready) return;
    [canvas.width, canvas.height, canvas.dataset.ready] = [width, height, "yes"];
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    const attach = (texture, point, inside, format, type) => {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, type, null);
      for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, point, gl.TEXTURE_2D, texture, 0);
    };
    attach(image, gl.COLOR_ATTACHMENT0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
    attach(depth, gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT);
  };

  // Camera ----------------------------------------------------------------------------------------------------------
  const firstView = () => ({
    target: [...settings.target], azimuth: settings.azimuth, elevation: settings.elevation, distance: settings.distance,
  });
  let camera = firstView();
  let byHeight = false;
  const heads = document.querySelectorAll("#sensors input");
  const axes = () => {
    const [a, e] = [camera.azimuth * RADIANS, camera.elevation * RADIANS];
    const forward = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), -Math.sin(e)];
    const right = [Math.sin(a), -Math.cos(a), 0];
    const up = [Math.sin(e) * Math.cos(a), Math.sin(e) * Math.sin(a), Math.cos(e)];
    return { forward, right, up };
  };
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  const draw = () => {
    const { forward, right, up } = axes();
    const slope = Math.tan((settings.fov * RADIANS) / 2);
    const aspect = canvas.width / canvas.height;
    const [near, far] = [Math.max(0.05, camera.distance * 0.02), camera.distance + 400];
    const [step, middle] = [settings.step, settings.middle];
    const from = camera.target.map((value, k) => middle[k] - (value - camera.distance * forward[k])); // camera to middle
    const [sx, sy, sz, tz] = [1 / (slope * aspect), 1 / slope, (far + near) / (far - near), (-2 * far * near) / (far - near)];
    const rows = [right.map((v) => v * sx), up.map((v) => v * sy), forward.map((v) => v * sz), forward];
    const clip = new Float32Array(16);
    rows.forEach((row, r) => {
      for (let c = 0; c < 3; c++) clip[4 * c + r] = row[c] * step;
      clip[12 + r] = dot(row, from) + (r === 2 ? tz : 0);
    });

    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(...BACKGROUND, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(points.made);
    const p = points.uniforms;
    gl.uniformMatrix4fv(p.clip_from_steps, false, clip);
    gl.uniform4fv(p.colours, colours);
    gl.uniform1i(p.byHeight, byHeight ? 1 : 0);
    gl.uniform1i(p.path, settings.path);
    gl.uniform1f(p.step_m, step);
    gl.uniform1f(p.middle_z, middle[2]);
    gl.uniform1f(p.low, settings.low);
    gl.uniform1f(p.high, settings.high);
    gl.uniform1f(p.size_px, (1.35 * settings.voxel * canvas.height) / (2 * slope));
    gl.uniform1f(p.smallest, 1.5 * (canvas.height / canvas.clientHeight || 1));
    gl.bindVertexArray(cloud);
    (settings.sensors || [[0, settings.count]]).forEach(([first, count], k) => {
      if (!heads[k] || heads[k].checked) gl.drawArrays(gl.POINTS, first, count);
    });

    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(shade.made);
    [image, depth].forEach((texture, k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.uniform1i(shade.uniforms.image, 0);
    gl.uniform1i(shade.uniforms.depth, 1);
    gl.uniform1f(shade.uniforms.near, near);
    gl.uniform1f(shade.uniforms.far, far);
    gl.uniform1f(shade.uniforms.thick, 8 * settings.voxel);
    gl.uniform1i(shade.uniforms.radius, Math.max(1, Math.round(canvas.height / canvas.clientHeight || 1)));
    gl.bindVertexArray(empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.activeTexture(gl.TEXTURE0);
  };
  let asked = false;
  const redraw = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      draw();
    });
  };

  const orbit = (dx, dy) => {
    camera.azimuth -= 0.35 * dx;
    camera.elevation = Math.min(89, Math.max(-20, camera.elevation + 0.35 * dy));
    redraw();
  };
  const move = (dx, dy) => {
    const { right, up } = axes();
    const metres = (2 * camera.distance * Math.tan((settings.fov * RADIANS) / 2)) / canvas.clientHeight;
    camera.target = camera.target.map((value, k) => value - metres * (right[k] * dx - up[k] * dy));
    redraw();
  };
  const zoom = (factor) => {
    camera.distance = Math.min(600, Math.max(0.5, camera.distance * factor));
    redraw();
  };
  const home = () => redraw((camera = firstView()));

  // Input -------------------------------------------------------------------------------------------------------------
  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }
  const span = () => {
    const [[ax, ay], [bx, by]] = [...fingers.values()];
    return { apart: Math.hypot(ax - bx, ay - by), x: (ax + bx) / 2, y: (ay + by) / 2 };
  };
  canvas.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const before = fingers.size === 2 ? span() : null;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (before) {
      const now = span();
      zoom(before.apart / Math.max(now.apart, 1));
      move(now.x - before.x, now.y - before.y);
    } else if (event.shiftKey || event.buttons & 6) move(event.clientX - last[0], event.clientY - last[1]);
    else orbit(event.clientX - last[0], event.clientY - last[1]);
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", home);
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return; // the page scrolls
    event.preventDefault();
    zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.004));
  }, { passive: false });
  const keys = {
    ArrowLeft: () => orbit(-24, 0), ArrowRight: () => orbit(24, 0), ArrowUp: () => orbit(0, -16), ArrowDown: () => orbit(0, 16),
    "+": () => zoom(0.85), "=": () => zoom(0.85), "-": () => zoom(1 / 0.85), Home: home,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });

  // Panel -------------------------------------------------------------------------------------------------------------
  const boxes = [...document.querySelectorAll("#legend input")];
  const show = () => {
    boxes.forEach((box) => (colours[4 * box.value + 3] = box.checked ? 1 : 0));
    redraw();
  };
  const tick = (state) => () => {
    boxes.forEach((box) => (box.checked = state));
    show();
  };
  [...boxes, ...heads].forEach((box) => box.addEventListener("change", show));
  document.getElementById("all").addEventListener("click", tick(true));
  document.getElementById("none").addEventListener("click", tick(false));
  document.getElementById("home").addEventListener("click", home);
  for (const mode of document.querySelectorAll('input[name="colour"]')) {
    mode.addEventListener("change", () => {
      byHeight = mode.value === "height";
      document.getElementById("ramp").hidden = !byHeight;
      redraw();
    });
  }

  canvas.hidden = false;
  canvas.addEventListener("webglcontextlost", () => (canvas.hidden = true));
  new ResizeObserver(() => draw(resize())).observe(canvas);
  resize();
  show();
})();
