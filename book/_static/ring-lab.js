// The interactive figure of the chapter on circles: one ring, its ellipse, and the poses that explain it.
// RingLab.solve is plain geometry, which tests/check_book.py compares with lmmap; the rest draws.
(() => {
  const CAMERA = { width: 346, height: 260, cx: 172.5, cy: 129.5, pitch_m: 18.5e-6, lens_mm: 6 };
  const RADIUS_M = 0.08; // of the ring's centre line, with the 6 mm lens
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
  const unit = (a) => times(a, 1 / Math.sqrt(dot(a, a)));
  const angle_deg = (a, b) => {
    const c = cross(a, b);
    return (Math.atan2(Math.sqrt(dot(c, c)), dot(a, b)) * 180) / Math.PI;
  };

  // Cone of the lines of sight through a circle: d^2 I - d (n p' + p n') + (p.p - r^2) n n', with d = n.p
  function cone(n, p, r) {
    const d = dot(n, p);
    const k = dot(p, p) - r * r;
    const at = (i, j) => (i === j ? d * d : 0) - d * (n[i] * p[j] + p[i] * n[j]) + k * n[i] * n[j];
    return [0, 1, 2].map((i) => [0, 1, 2].map((j) => at(i, j)));
  }

  // Eigenvalues, largest first, and eigenvectors of a symmetric 3 x 3 matrix, by Jacobi's rotations
  function eigen(matrix) {
    const A = matrix.map((row) => row.slice());
    const V = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    for (let sweep = 0; sweep < 30; sweep++) {
      for (const [i, j] of [[0, 1], [0, 2], [1, 2]]) {
        if (Math.abs(A[i][j]) < 1e-300) continue;
        const phi = 0.5 * Math.atan2(2 * A[i][j], A[j][j] - A[i][i]);
        const c = Math.cos(phi);
        const s = Math.sin(phi);
        for (let k = 0; k < 3; k++) [A[k][i], A[k][j]] = [c * A[k][i] - s * A[k][j], s * A[k][i] + c * A[k][j]];
        for (let k = 0; k < 3; k++) [A[i][k], A[j][k]] = [c * A[i][k] - s * A[j][k], s * A[i][k] + c * A[j][k]];
        for (let k = 0; k < 3; k++) [V[k][i], V[k][j]] = [c * V[k][i] - s * V[k][j], s * V[k][i] + c * V[k][j]];
      }
    }
    const order = [0, 1, 2].sort((a, b) => A[b][b] - A[a][a]);
    return { values: order.map((k) => A[k][k]), vectors: order.map((k) => [V[0][k], V[1][k], V[2][k]]) };
  }

  // Both circles of radius r on a cone, normals toward the camera
  function exactPoses(Q, r) {
    const { values: [l1, l2, l3], vectors: [e1, , e] } = eigen(Q);
    const e3 = e[2] < 0 ? times(e, -1) : e;
    const n1 = Math.sqrt(Math.max(l1 - l2, 0) / (l1 - l3));
    const n3 = Math.sqrt((l2 - l3) / (l1 - l3));
    const scale = r / Math.sqrt(-l1 * l3);
    return [n1, -n1].map((a) => ({
      n: times(add(times(e1, a), e3, n3), -1),
      p: times(add(times(e1, l3 * a), e3, l1 * n3), scale),
    }));
  }

  // Ellipse in pixels: centre, semi-axes, unit directions of major and minor axis
  function ellipse(Q, f) {
    const G = [[1 / f, 0, -CAMERA.cx / f], [0, 1 / f, -CAMERA.cy / f], [0, 0, 1]];
    const QG = Q.map((row) => [0, 1, 2].map((j) => row[0] * G[0][j] + row[1] * G[1][j] + row[2] * G[2][j]));
    const C = [0, 1, 2].map((i) => [0, 1, 2].map((j) => G[0][i] * QG[0][j] + G[1][i] * QG[1][j] + G[2][i] * QG[2][j]));
    const [[a, b, d], [, c, e], [, , g]] = C;
    const det = a * c - b * b;
    const centre = [(b * e - c * d) / det, (b * d - a * e) / det];
    const gain = -g - d * centre[0] - e * centre[1];
    const mean = (a + c) / 2;
    const half = Math.hypot((a - c) / 2, b);
    const phi = 0.5 * Math.atan2(-2 * b, c - a);
    const semi = [Math.sqrt(gain / (mean - half)), Math.sqrt(gain / (mean + half))];
    return { centre, semi, major: [Math.cos(phi), Math.sin(phi)], minor: [-Math.sin(phi), Math.cos(phi)] };
  }

  // The formulas that the paper prints: centre from the major axis, normals from the minor axis' nearer ends
  function printedPoses(E, f, r) {
    const ray = ([u, v]) => unit([(u - CAMERA.cx) / f, (v - CAMERA.cy) / f, 1]);
    const end = (axis, length) => ray([E.centre[0] + length * axis[0], E.centre[1] + length * axis[1]]);
    const [M1, M2] = [end(E.major, E.semi[0]), end(E.major, -E.semi[0])];
    const chord = add(M2, M1, -1);
    const p = times(add(M1, M2), r / Math.sqrt(dot(chord, chord)));
    return [E.semi[1], -E.semi[1]].map((length) => {
      const v = end(E.minor, length);
      const along = dot(v, p);
      const depth = along - Math.sqrt(Math.max(along * along - dot(p, p) + r * r, 0));
      const n = unit(cross(chord, add(times(v, depth), p, -1)));
      return { n: dot(n, p) < 0 ? n : times(n, -1), p };
    });
  }

  function solve({ tilt_deg, toward_deg, distance_m, u_px, v_px, lens_mm, same_image }) {
    const f = (lens_mm * 1e-3) / CAMERA.pitch_m;
    const r = same_image ? (RADIUS_M * CAMERA.lens_mm) / lens_mm : RADIUS_M;
    const [tilt, toward] = [tilt_deg, toward_deg].map((x) => (x * Math.PI) / 180);
    const p = times([(u_px - CAMERA.cx) / f, (v_px - CAMERA.cy) / f, 1], distance_m);
    const n = [Math.sin(tilt) * Math.cos(toward), Math.sin(tilt) * Math.sin(toward), -Math.cos(tilt)];
    const Q = cone(n, p, r);
    const seen = ellipse(Q, f);
    const [first, second] = exactPoses(Q, r);
    const swap = angle_deg(second.n, n) < angle_deg(first.n, n);
    const [right, twin] = swap ? [second, first] : [first, second];
    const both = printedPoses(seen, f, r);
    const printed = angle_deg(both[1].n, n) < angle_deg(both[0].n, n) ? both[1] : both[0];
    const shift = add(printed.p, p, -1);
    return {
      f, r, n, p, seen, right, twin, printed,
      exact_deg: angle_deg(right.n, n), twin_deg: angle_deg(twin.n, n), printed_deg: angle_deg(printed.n, n),
      printed_mm: 1e3 * Math.sqrt(dot(shift, shift)),
      offset_px: Math.hypot(seen.centre[0] - u_px, seen.centre[1] - v_px),
    };
  }

  function circle({ n, p }, r, count = 72) {
    const a = unit(cross(n, Math.abs(n[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
    const b = cross(n, a);
    return Array.from({ length: count }, (_, k) => {
      const s = (2 * Math.PI * k) / count;
      return add(add(p, a, r * Math.cos(s)), b, r * Math.sin(s));
    });
  }

  const SLIDERS = [
    ["tilt_deg", "tilt", 0, 70, 1, "°"], ["toward_deg", "direction of the tilt", -180, 180, 5, "°"],
    ["distance_m", "distance", 0.25, 1.2, 0.01, " m"], ["u_px", "place, right", 20, 325, 1, " px"],
    ["v_px", "place, down", 20, 240, 1, " px"], ["lens_mm", "lens", 4, 12, 0.5, " mm"],
  ];
  const START = { tilt_deg: 35, toward_deg: -90, distance_m: 0.35, u_px: 172, v_px: 130, lens_mm: 6, same_image: true };
  const line = (points, closed) => points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("") + (closed ? "Z" : "");

  // What both panels draw: a list of [class, path]
  function imagePaths(S) {
    const pixel = ([x, y, z]) => [(S.f * x) / z + CAMERA.cx, (S.f * y) / z + CAMERA.cy];
    const { centre: [u, v], semi, major, minor } = S.seen;
    const axis = (d, a) => line([[u - a * d[0], v - a * d[1]], [u + a * d[0], v + a * d[1]]]);
    const [cu, cv] = pixel(S.p);
    return [
      ["frame", `M0 0H${CAMERA.width}V${CAMERA.height}H0Z`],
      ["axis", axis(major, semi[0]) + axis(minor, semi[1])],
      ["printed", line(circle(S.printed, S.r).map(pixel), true)],
      ["truth", line(circle(S, S.r).map(pixel), true)],
      ["ellipse-centre", `M${u - 5} ${v - 5}l10 10m0 -10l-10 10`],
      ["truth dot", `M${cu - 3.5} ${cv}a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0 -7 0Z`],
    ];
  }

  function spacePaths(S, view) {
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    const zoom = 270 / (S.p[2] + 0.12);
    const flat = ([x, y, z]) => {
      const depth = cy * x - sy * z; // depth to the right, turned by yaw about the vertical, then by pitch
      return [30 + zoom * (cy * z + sy * x), 130 + zoom * (cp * y + sp * depth)];
    };
    const arrow = ({ n, p }) => line([flat(p), flat(add(p, n, 0.9 * S.r))]);
    const tip = ([u, v]) => [(0.11 * (u - CAMERA.cx)) / S.f, (0.11 * (v - CAMERA.cy)) / S.f, 0.11];
    const corners = [[0, 0], [CAMERA.width, 0], [CAMERA.width, CAMERA.height], [0, CAMERA.height]].map(tip);
    const eye = flat([0, 0, 0]);
    const rays = circle(S, S.r, 18).map((x) => line([eye, flat(x)])).join("");
    return [
      ["ray", rays],
      ["camera", line(corners.map(flat), true) + corners.map((x) => line([eye, flat(x)])).join("")],
      ["printed", line(circle(S.printed, S.r).map(flat), true) + arrow(S.printed)],
      ["twin", line(circle(S.twin, S.r).map(flat), true) + arrow(S.twin)],
      ["truth", line(circle(S, S.r).map(flat), true) + arrow(S)],
    ];
  }

  const paths = (list) => list.map(([name, d]) => `<path class="${name}" d="${d}"/>`).join("");

  // What the printed formula's median over the test's poses is with a lens, between the lenses of a table
  function medianText({ medians, band: [least, most] }, { lens_mm, same_image }) {
    if (!same_image) return "";
    const k = Math.min(Math.max(medians.findIndex(([lens]) => lens >= lens_mm), 1), medians.length - 1);
    const [[a, from], [b, to]] = [medians[k - 1], medians[k]];
    const median = from + ((to - from) * (lens_mm - a)) / (b - a);
    const where = median > most ? "above" : median < least ? "below" : "within";
    return ` With this lens, its median error over the test's poses is <b>${median.toFixed(1)}°</b>, ${where} the ${least.toFixed(1)} to ${most.toFixed(1)}° of Table I.`;
  }

  function start(root) {
    const state = { ...START };
    const table = JSON.parse(root.dataset.table);
    const view = { yaw: 0.5, pitch: 0.35 };
    root.innerHTML = `<div class="views">
      <svg class="space" viewBox="0 0 346 260" tabindex="0" role="img" aria-label="camera, cone of sight and circles in space; drag or use the arrow keys to look from elsewhere"></svg>
      <svg class="image" viewBox="-2 -2 350 264" tabindex="0" role="img" aria-label="the camera's image; drag or use the arrow keys to move the ring"></svg></div>
      <p class="legend"><span class="truth">the ring</span> <span class="twin">its twin</span> <span class="printed">the printed formula's circle</span> <span>× the ellipse's centre</span> <span><b class="ring-centre">●</b> the ring's centre</span></p>
      <div class="controls">${SLIDERS.map(([key, name, low, high, step]) => `<label>${name} <output></output><input type="range" name="${key}" min="${low}" max="${high}" step="${step}"></label>`).join("")}
      <label class="check"><input type="checkbox" name="same_image"> keep the size of the ring's image when the lens changes (the paper fixes only that size)</label>
      <p class="buttons"><button type="button" data-set='{"tilt_deg":0,"distance_m":0.6,"u_px":172.5,"v_px":129.5}'>head-on at 0.6 m</button> <button type="button" data-set='{"tilt_deg":45,"distance_m":0.6}'>45° at 0.6 m</button> <button type="button" data-set='${JSON.stringify(START)}'>start again</button></p></div>
      <p class="said" aria-live="polite"></p>`;
    const [space, image] = root.querySelectorAll("svg");
    const inputs = [...root.querySelectorAll("input")];

    function draw() {
      const S = solve(state);
      root.solved = S;
      space.innerHTML = paths(spacePaths(S, view));
      image.innerHTML = paths(imagePaths(S));
      SLIDERS.forEach(([key, , , , , unit_], k) => {
        inputs[k].value = state[key];
        inputs[k].previousElementSibling.textContent = `${state[key]}${unit_}`;
      });
      inputs.at(-1).checked = state.same_image;
      root.querySelector(".said").innerHTML =
        `Printed formula: normal off by <b>${S.printed_deg.toFixed(1)}°</b>, position by ${S.printed_mm.toFixed(1)} mm.` +
        `${medianText(table, state)} Exact: ${S.exact_deg.toFixed(1)}°, and a twin ${S.twin_deg.toFixed(1)}° away. ` +
        `The ellipse's centre is ${S.offset_px.toFixed(2)} px from the image of the ring's centre.`;
    }
    const clamp = (key, value) => {
      const [, , low, high, step] = SLIDERS.find(([name]) => name === key);
      state[key] = Math.min(high, Math.max(low, +(Math.round(value / step) * step).toFixed(2)));
    };
    inputs.forEach((input) => input.addEventListener("input", () => {
      if (input.type === "checkbox") state.same_image = input.checked;
      else clamp(input.name, +input.value);
      draw();
    }));
    root.querySelectorAll("button").forEach((b) => b.addEventListener("click", () => {
      Object.assign(state, JSON.parse(b.dataset.set));
      draw();
    }));
    const move = (svg, by) => {
      let last = null;
      svg.addEventListener("pointerdown", (e) => { last = [e.clientX, e.clientY]; svg.setPointerCapture(e.pointerId); });
      svg.addEventListener("pointermove", (e) => {
        if (!last) return;
        const scale = 346 / svg.clientWidth;
        by((e.clientX - last[0]) * scale, (e.clientY - last[1]) * scale);
        last = [e.clientX, e.clientY];
        draw();
      });
      ["pointerup", "pointercancel"].forEach((name) => svg.addEventListener(name, () => { last = null; }));
      svg.addEventListener("keydown", (e) => {
        const step = { ArrowLeft: [-4, 0], ArrowRight: [4, 0], ArrowUp: [0, -4], ArrowDown: [0, 4] }[e.key];
        if (!step) return;
        e.preventDefault();
        by(...step);
        draw();
      });
    };
    move(image, (du, dv) => { clamp("u_px", state.u_px + du); clamp("v_px", state.v_px + dv); });
    move(space, (du, dv) => {
      view.yaw += du * 0.012;
      view.pitch = Math.min(1.5, Math.max(-1.5, view.pitch + dv * 0.012));
    });
    draw();
  }

  window.RingLab = { solve, START, medianText };
  document.querySelectorAll(".ring-lab:empty").forEach(start);
})();
