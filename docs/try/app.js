// Two allocators, called as the controllers call them, beside each other. Vectors are flat arrays; forces in N, angles in rad.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("try-data").textContent);
  const root = document.getElementById("try");
  const DT = 0.01, GRAVITY = data.safe.team.g, RAD = Math.PI / 180, KINDS = ["sqp", "safe"], LONGEST = 0.1;

  // Parameters: as Sqp.params and Safe.params pack them for a uniform team

  function packed(kind, values, n, drone = {}) {
    const { places, team, drone: each } = data[kind];
    const vector = new Float64Array(places.rows + places.width * n);
    for (const [name, value] of Object.entries({ ...team, ...values })) vector[places[name]] = value;
    for (let i = 0; i < n; ++i)
      for (const [name, value] of Object.entries({ ...each, ...drone }))
        vector[places.rows + places.width * i + places[name]] = value;
    return vector;
  }

  const params = {
    sqp: ({ n, mu }) => packed("sqp", { mu }, n),
    safe({ n, load_mass, mu, min_angle_deg, max_cone_deg, tension_min, tension_max }) {
      const least = min_angle_deg * RAD, cone = max_cone_deg * RAD;
      const spacing = Math.sqrt(1.15 * 2 * Math.PI * (1 - Math.cos(cone)) / n);
      const reach = Math.min(Math.max(1.8 * spacing - least, 0.3 * least), 60 * RAD);
      const own = packed("safe", {
        mu, sigma: load_mass * GRAVITY / n, min_angle: least, reach, cone, cos_angle: Math.cos(least),
        cos_edge: Math.cos(Math.min(least + reach, Math.PI)), cos_cone: Math.cos(cone), total: n * tension_max,
      }, n, { T_min: tension_min, T_max: tension_max });
      const table = new Float64Array(n * n);
      for (let i = 0; i < n; ++i)
        for (let j = 0; j < n; ++j) table[n * i + j] = j < i ? data.cause : Math.cos(least);
      return Float64Array.of(...own, ...table);
    },
  };

  // Start: a ring on which neighbours keep the least angle with some room, if the cone has it

  function ring({ n, min_angle_deg, max_cone_deg }) {
    const reach = Math.sin(0.55 * min_angle_deg * RAD) / Math.sin(Math.PI / n);
    const lean = Math.min(Math.max(35 * RAD, reach < 1 ? Math.asin(reach) : 0.5 * Math.PI), 0.95 * max_cone_deg * RAD);
    return Array.from({ length: n }, (_, i) => {
      const azimuth = 2 * Math.PI * i / n;
      return [-Math.sin(lean) * Math.cos(azimuth), -Math.sin(lean) * Math.sin(azimuth), -Math.cos(lean)];
    }).flat();
  }

  const bytes = Uint8Array.from(atob(data.wasm), (letter) => letter.charCodeAt(0));
  const compiled = WebAssembly.compile(bytes);

  /** Both allocators, with memories of their own. */
  async function make(settings, start) {
    const { exports } = await WebAssembly.instantiate(await compiled, {});
    const at = (kind, what, length) => new Float64Array(exports.memory.buffer, exports[`${kind}_${what}`](), length);
    const made = {};
    for (const kind of KINDS) {
      const answer = { status: 0, calls: 0, spent: 0, n: 0 };
      answer.set = (wanted) => {
        const vector = params[kind](wanted);
        at(kind, "params", vector.length).set(vector);
      };
      answer.reset = (wanted, directions) => {
        const n = answer.n = wanted.n;
        at(kind, "memory", data[kind].memory).fill(0);
        answer.tensions = at(kind, "tensions", n).fill(0);
        answer.directions = at(kind, "directions", 3 * n);
        answer.directions.set(directions);
        answer.info = at(kind, "info", 7).fill(0);
        answer.set(wanted);
      };
      answer.ask = (force, dt = DT) => {
        at(kind, "force", 3).set(force);
        const before = performance.now();
        answer.status = exports[`${kind}_ask`](answer.n, dt);
        answer.spent += performance.now() - before;
        answer.calls += 1;
      };
      answer.reset(settings, start ?? ring(settings));
      made[kind] = answer;
    }
    return made;
  }

  // What is wanted

  const field = (name) => root.querySelector(`[name=${name}]`);
  const NAMES = [...root.querySelectorAll(".try-settings input")].map((input) => input.name);
  const wish = [0, 0, 1]; // in weights of the load
  let settings, both, time = 0, azimuth = 0.3 - Math.PI / 2, elevation = 0.6; // x to the right, as on the pads

  function read(changed) {
    const low = field("tension_min"), high = field("tension_max");
    if (1.2 * low.value > Number(high.value)) { // the other one gives way
      if (changed === low) high.value = Math.ceil(12 * low.value) / 10;
      else low.value = Math.floor(100 * high.value / 1.2) / 100;
    }
    settings = Object.fromEntries(NAMES.map((name) => [name, Number(field(name).value)]));
    for (const name of NAMES) field(name).previousElementSibling.textContent = settings[name];
  }

  function normal() { // Box and Muller
    return Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());
  }

  function force() {
    const W = settings.load_mass * GRAVITY, turn = field("circle").checked ? 0.25 : 0;
    const circle = [turn * Math.cos(0.9 * time), turn * Math.sin(0.9 * time), 0], noise = field("noise").checked ? 0.05 : 0;
    return wish.map((value, k) => W * (value + circle[k] + (noise && noise * normal())));
  }

  const restart = (directions) => KINDS.forEach((kind) => both[kind].reset(settings, directions ?? ring(settings)));

  // Pictures

  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  /** The context of a canvas as sharp as the screen, and its size in points. */
  function sheet(canvas) {
    const { width, height } = canvas.getBoundingClientRect(), ratio = devicePixelRatio;
    if (canvas.width !== Math.round(width * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return { pen, width, height };
  }

  function stroke(pen, from, to, style, width) {
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
  }

  function arrow(pen, from, to, style) {
    stroke(pen, from, to, style, 2.5);
    const [x, y] = [to[0] - from[0], to[1] - from[1]], length = Math.hypot(x, y);
    if (length < 4) return;
    for (const side of [0.5, -0.5]) {
      const c = Math.cos(Math.PI - side) / length * 9, s = Math.sin(Math.PI - side) / length * 9;
      stroke(pen, to, [to[0] + c * x - s * y, to[1] + s * x + c * y], style, 2.5);
    }
  }

  function dot(pen, [x, y], radius, style) {
    pen.fillStyle = style;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fill();
  }

  // Pads: weights of the load over the width, and where no force is
  const PADS = { top: { up: 1, most: 1.5, zero: 0.5 }, side: { up: 2, most: 1.25, zero: 0.75 } };

  function drawPad(canvas, now, total) {
    const { pen, width, height } = sheet(canvas), { up, most, zero } = PADS[canvas.dataset.pad];
    const scale = width / 2 / most, origin = [width / 2, height * zero], W = settings.load_mass * GRAVITY;
    const spot = (f) => [origin[0] + scale * f[0] / W, origin[1] - scale * f[up] / W];
    stroke(pen, [0, origin[1]], [width, origin[1]], colour("--faint"), 1);
    stroke(pen, [origin[0], 0], [origin[0], height], colour("--faint"), 1);
    arrow(pen, origin, spot(now), colour("--ink"));
    total.forEach((given, k) => dot(pen, spot(given), 6 - 2 * k, [colour("--calm"), colour("--mark")][k]));
  }

  /** From a place in space to one in the picture, and back to a direction on the sphere of the cables. */
  function camera(width, height) {
    const [c, s, a, b] = [Math.cos(azimuth), Math.sin(azimuth), Math.sin(elevation), Math.cos(elevation)];
    const axes = [[-s, c, 0], [-a * c, -a * s, b], [b * c, b * s, a]], size = 0.44 * width;
    const centre = [width / 2, height * (0.5 + 0.13 * b)], along = (k, p) => axes[k][0] * p[0] + axes[k][1] * p[1] + axes[k][2] * p[2];
    return {
      spot: (p) => [centre[0] + size * along(0, p), centre[1] - size * along(1, p)],
      depth: (p) => along(2, p),
      lift([x, y], near) {
        const u = (x - centre[0]) / size, v = (centre[1] - y) / size, length = Math.max(Math.hypot(u, v), 1);
        const w = Math.sqrt(Math.max(1 - (u * u + v * v) / length ** 2, 0)) * (near ? 1 : -1);
        return [0, 1, 2].map((k) => u / length * axes[0][k] + v / length * axes[1][k] + w * axes[2][k]);
      },
    };
  }

  const places = (answer) => Array.from({ length: answer.n }, (_, i) => [0, 1, 2].map((k) => -answer.directions[3 * i + k]));

  function drawCables(canvas, answer, now, most) {
    const { pen, width, height } = sheet(canvas), { spot, depth } = camera(width, height), drones = places(answer);
    const circle = (lean, style) => {
      const edge = Array.from({ length: 65 }, (_, k) => spot([Math.sin(lean) * Math.cos(k * Math.PI / 32), Math.sin(lean) * Math.sin(k * Math.PI / 32), Math.cos(lean)]));
      for (let k = 0; k < 64; ++k) stroke(pen, edge[k], edge[k + 1], style, 1);
    };
    circle(Math.PI / 2, colour("--faint"));
    circle(settings.max_cone_deg * RAD, colour("--faint"));
    const order = drones.map((_, i) => i).sort((i, j) => depth(drones[i]) - depth(drones[j]));
    for (const i of order) {
      stroke(pen, spot([0, 0, 0]), spot(drones[i]), colour("--calm"), 1 + 4 * Math.min(answer.tensions[i] / most, 1));
      dot(pen, spot(drones[i]), 6 + 1.5 * depth(drones[i]), colour("--ink"));
      pen.fillStyle = colour("--calm");
      pen.font = "11px sans-serif";
      const [x, y] = spot(drones[i].map((value) => 1.14 * value));
      pen.fillText(String(i), x - 3, y + 4);
    }
    arrow(pen, spot([0, 0, 0]), spot(now.map((value) => 0.5 * value / settings.load_mass / GRAVITY)), colour("--mark"));
    dot(pen, spot([0, 0, 0]), 5, colour("--mark"));
  }

  function leastAngle(answer) {
    let least = Math.PI;
    const drones = places(answer);
    for (let i = 0; i < answer.n; ++i)
      for (let j = 0; j < i; ++j) {
        const chord = Math.hypot(...drones[i].map((value, k) => value - drones[j][k]));
        least = Math.min(least, 2 * Math.asin(Math.min(0.5 * chord, 1)));
      }
    return least / RAD;
  }

  const sum = (answer) => [0, 1, 2].map((k) => answer.tensions.reduce((all, T, i) => all - T * answer.directions[3 * i + k], 0));

  function tell(section, answer, most) {
    const bars = section.querySelector(".try-bars"), { tension_min: low, tension_max: high } = settings;
    bars.replaceChildren(...[...answer.tensions].map((T, i) => {
      const row = document.createElement("div"), bar = document.createElement("i"), value = document.createElement("b");
      const broken = T < low - 1e-9 || T > high + 1e-9;
      bar.style.setProperty("--share", `${Math.min(100 * T / most, 100)}%`);
      bar.style.setProperty("--tone", broken ? "var(--mark)" : "var(--calm)");
      value.textContent = `${T.toFixed(2)} N`;
      value.classList.toggle("try-broken", broken);
      row.append(String(i), bar, value);
      return row;
    }));
    const angle = leastAngle(answer), [word, meaning] = data.statuses[answer.status], { iterations, balance } = data.info;
    const lean = Math.max(...places(answer).map(([x, y, z]) => Math.atan2(Math.hypot(x, y), z))) / RAD;
    const rows = [
      ["least angle", `${angle.toFixed(1)}°`, angle < settings.min_angle_deg - 1e-6],
      ["widest lean", `${lean.toFixed(1)}°`, lean > settings.max_cone_deg + 1e-6],
      ["force missing", `${answer.info[balance].toFixed(3)} N`, answer.info[balance] > 1e-3],
      ["iterations", String(answer.info[iterations]), false],
      ["a call takes", answer.mean === undefined ? "…" : `${answer.mean.toFixed(1)} µs`, false],
      ["status", word, answer.status !== 0],
    ];
    section.querySelector("dl").innerHTML = rows.map(([name, value, broken]) => `<dt>${name}</dt><dd${broken ? ' class="try-broken"' : ""}>${value}</dd>`).join("")
      + `<dd class="try-said">${meaning}</dd>`;
  }

  function draw(now) {
    const totals = KINDS.map((kind) => sum(both[kind]));
    root.querySelectorAll("[data-pad]").forEach((pad) => drawPad(pad, now, totals));
    root.querySelector(".try-force").textContent = `F = (${now.map((value) => value.toFixed(2)).join(", ")}) N`;
    // A bar as long as what the hardest pulled cable of either holds, lest a large limit hide all others.
    const most = Math.min(settings.tension_max, 2 * Math.max(...KINDS.flatMap((kind) => [...both[kind].tensions]), 0.1));
    for (const section of root.querySelectorAll("section")) {
      const answer = both[section.dataset.kind];
      drawCables(section.querySelector("canvas"), answer, now, most);
      tell(section, answer, most);
    }
  }

  // Hands

  function dragged(canvas, begin) {
    let going = null;
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      going = begin(place(event));
      going?.(place(event));
    });
    canvas.addEventListener("pointermove", (event) => going?.(place(event)));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { going = null; });
  }

  const held = (value) => Math.min(Math.max(value, -1.5), 2);

  for (const canvas of root.querySelectorAll("[data-pad]")) {
    const { up, most, zero } = PADS[canvas.dataset.pad];
    dragged(canvas, () => ([x, y]) => {
      const { width, height } = canvas.getBoundingClientRect(), scale = width / 2 / most;
      wish[0] = held((x - width / 2) / scale);
      wish[up] = held((height * zero - y) / scale);
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [up, 1], ArrowDown: [up, -1] }[event.key];
      if (!step) return;
      event.preventDefault();
      wish[step[0]] = held(wish[step[0]] + 0.05 * step[1]);
    });
  }

  for (const section of root.querySelectorAll("section")) {
    const canvas = section.querySelector("canvas"), answer = () => both[section.dataset.kind];
    dragged(canvas, (at) => {
      const { width, height } = canvas.getBoundingClientRect(), drones = places(answer());
      const { spot, depth, lift } = camera(width, height);
      const far = drones.map((drone) => Math.hypot(...spot(drone).map((value, k) => value - at[k])));
      const i = far.indexOf(Math.min(...far));
      if (far[i] < 22) { // a cable: both start from there
        const near = depth(drones[i]) >= 0;
        return (to) => {
          const directions = [...answer().directions], drone = lift(to, near);
          for (let k = 0; k < 3; ++k) directions[3 * i + k] = -drone[k];
          restart(directions);
        };
      }
      const from = [azimuth, elevation];
      return ([x, y]) => {
        azimuth = from[0] - 0.01 * (x - at[0]);
        elevation = Math.min(Math.max(from[1] + 0.01 * (y - at[1]), 0), Math.PI / 2);
      };
    });
  }

  root.querySelector(".try-settings").addEventListener("input", (event) => {
    read(event.target);
    if (event.target.name === "n") restart();
    else KINDS.forEach((kind) => both[kind].set(settings)); // goes on from its last answer
  });
  root.querySelector("[data-do=ring]").addEventListener("click", () => restart());
  root.querySelector("[data-do=level]").addEventListener("click", () => wish.splice(0, 3, 0, 0, 1));

  // Both are called every DT of the clock; time that a hidden page slept is not made up for.
  let last = null, owed = 0, told = 0;
  function frame(clock) {
    owed = Math.min(owed + (last === null ? DT : (clock - last) / 1000), LONGEST);
    last = clock;
    let now = null;
    for (; owed >= DT; owed -= DT) {
      time += DT;
      now = force();
      KINDS.forEach((kind) => both[kind].ask(now));
    }
    if (clock - told > 2000) {
      told = clock;
      for (const kind of KINDS) {
        const answer = both[kind];
        if (answer.calls) answer.mean = 1000 * answer.spent / answer.calls;
        answer.calls = answer.spent = 0;
      }
    }
    if (now) draw(now);
    requestAnimationFrame(frame);
  }

  read();
  make(settings).then((made) => {
    both = made;
    requestAnimationFrame(frame);
    root.dataset.ready = "";
  });
  const spots = (canvas, answer) => places(answer).map(camera(canvas.clientWidth, canvas.clientHeight).spot);
  window.tryAllocators = { params, ring, make, spots, state: () => ({ both, settings, wish }) };
})();
