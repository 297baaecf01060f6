// The array, live: one message a tick brings every height; a component of the studio's page, and by widget.js of notebooks. Drawn as SVG in an orthographic projection, in which a sphere is a
// circle from wherever it is seen: no 3-D hardware is needed, and every bubble is an element that can be focused and read.

const SVG = "http://www.w3.org/2000/svg";
const CIVIDIS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];
// Okabe and Ito's colours, which colour-blind people tell apart.
const STATUS = {
  resting: "#999999",
  moving: "#56b4e9",
  settled: "#009e73",
  unsure: "#f0e442",
  missed: "#cc79a7",
  stopped: "#0072b2",
  fault: "#d55e00",
  unknown: "#cccccc",
};
const WRIST_MM = 30; // radius of a forearm, about
const VIEWS = { above: [0, 90], oblique: [-28, 38], wrist: [-28, 32] };
const STRIP = { width: 600, height: 130, left: 34, right: 8, top: 8, bottom: 20, seconds: 20 };

const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));

function cividis(share) {
  const at = Math.min(Math.max(share || 0, 0), 1) * (CIVIDIS.length - 1);
  const low = Math.min(Math.floor(at), CIVIDIS.length - 2);
  const [a, b] = [rgb(CIVIDIS[low]), rgb(CIVIDIS[low + 1])];
  return a.map((value, i) => Math.round(value + (b[i] - value) * (at - low)));
}

function make(parent, tag, attributes = {}) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  parent.append(node);
  return node;
}

// How one looks at it is the browser tab's, where there is room for that: a notebook's frame may have none.
function recall(name) {
  try {
    return sessionStorage.getItem(name);
  } catch {
    return null;
  }
}

function keep(name, value) {
  try {
    sessionStorage.setItem(name, value);
  } catch {
    // as it was before
  }
}

let arrays = 0; // in this page: names of shades differ

const stamp = (event) => (performance.timeOrigin + event.timeStamp) / 1000;

// Arrow keys go to the nearest bubble in their direction.
function neighbour(positions, from, key) {
  const way = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[key];
  let best = from;
  let least = Infinity;
  positions.forEach(([x, y], bubble) => {
    const [dx, dy] = [x - positions[from][0], y - positions[from][1]];
    const along = dx * way[0] + dy * way[1];
    const across = Math.abs(dx * way[1]) + Math.abs(dy * way[0]);
    if (along > 0.1 && along + 2 * across < least) [best, least] = [bubble, along + 2 * across];
  });
  return best;
}

export default {
  template: `
    <div class="array">
      <div class="array-tools">
        <label>View <select data-keep="view" aria-label="View">
          <option value="oblique">Oblique</option><option value="above">From above</option><option value="wrist">On the wrist</option>
        </select></label>
        <label>Colour <select data-keep="colour" aria-label="Colour">
          <option value="height">Height</option><option value="pressure">Pressure</option><option value="status">State</option>
        </select></label>
        <div class="legend" aria-hidden="true"></div>
      </div>
      <p class="recorded" role="status" hidden></p>
      <svg class="array-figure" role="group" preserveAspectRatio="xMidYMid meet"></svg>
      <figure class="strip">
        <figcaption><span class="strip-title"></span>
          <span class="keys" aria-hidden="true"><i class="key line"></i>height <i class="key dash"></i>target <i class="key band"></i>± 1 sd</span></figcaption>
        <svg viewBox="0 0 600 130" role="img" aria-label="Height of the chosen bubble over the last 20 seconds"></svg>
      </figure>
      <details class="figures"><summary>All figures</summary>
        <div class="scroll" tabindex="0" role="region" aria-label="All figures"><table><thead><tr>
          <th scope="col">Bubble</th><th scope="col">Height (mm)</th><th scope="col">± sd</th><th scope="col">Target (mm)</th>
          <th scope="col">Pressure (kPa)</th><th scope="col">State</th></tr></thead><tbody></tbody></table></div>
      </details>
    </div>`,
  props: { positions: Array, pitch: Number, rest: Number, max: Number, pressure: Number },
  mounted() {
    this.past = [];
    this.recorded = "";
    this.latest = null;
    this.drawn = 0;
    this.due = false;
    this.chosen = Math.min(Number(recall("bubble") || 0), this.positions.length - 1);
    for (const select of this.$el.querySelectorAll("select")) {
      select.value = recall(select.dataset.keep) || select.value;
      select.addEventListener("change", () => {
        keep(select.dataset.keep, select.value);
        this.reset();
      });
    }
    this.build();
    this.buildStrip();
    this.reset();
    this.choose(this.chosen);
  },
  methods: {
    // What the server calls.

    record(what, message, before) {
      // A moment of a recording, or, where `what` is empty, what is now again.
      const said = this.$el.querySelector(".recorded");
      if (this.recorded !== what) {
        this.recorded = what;
        said.textContent = what && `${what}: this is a recording, and not what the wristband does now.`;
        said.hidden = !what;
        this.$el.classList.toggle("is-recorded", Boolean(what));
        this.newest.textContent = what ? "here" : "now";
      }
      this.past = before;
      if (message) this.take(message);
    },
    take(message) {
      this.latest = message;
      this.past.push(message);
      while (this.past.length && message.t - this.past[0].t > STRIP.seconds) this.past.shift();
      if (message.t < this.past[0].t) this.past = [message]; // another boot
      if (this.due) return;
      this.due = true; // however many messages come, a frame is drawn once
      requestAnimationFrame(() => {
        this.due = false;
        this.draw();
        this.svg.dataset.drawn = this.drawn += 1; // for those who measure
      });
    },
    history(messages) {
      this.past = messages;
    },
    foresee(tops) {
      // Where bubbles would stand; a wristband's own shape is drawn as before.
      this.foreseen = tops && tops.length === this.positions.length ? tops : null;
      this.draw();
    },

    // The camera.

    reset() {
      this.view = this.$el.querySelector("[data-keep=view]").value;
      this.colour = this.$el.querySelector("[data-keep=colour]").value;
      [this.azimuth, this.elevation] = VIEWS[this.view];
      this.legend();
      this.order();
      this.draw();
    },
    place(x, y, height) {
      // A point `height` above the base at x, y: right, down and away on the screen, mm.
      let z = height;
      if (this.view === "wrist") {
        const angle = x / WRIST_MM;
        x = (WRIST_MM + height) * Math.sin(angle);
        z = (WRIST_MM + height) * Math.cos(angle) - WRIST_MM;
      }
      const [a, e] = [(this.azimuth * Math.PI) / 180, (this.elevation * Math.PI) / 180];
      const [u, v] = [x * Math.cos(a) - y * Math.sin(a), x * Math.sin(a) + y * Math.cos(a)];
      return [u, -(v * Math.sin(e) + z * Math.cos(e)), v * Math.cos(e) - z * Math.sin(e)];
    },
    order() {
      // What is farther away is drawn first. Elements that are moved lose the focus, so it is given back.
      const focused = document.activeElement;
      const depth = this.positions.map(([x, y]) => this.place(x, y, 0)[2]);
      const far = this.positions.map((_, bubble) => bubble).sort((a, b) => depth[b] - depth[a]);
      for (const bubble of far) this.layer.append(this.bubbles[bubble].group);
      if (this.layer.contains(focused)) focused.focus({ preventScroll: true });
      const reach = Math.max(...this.positions.map(([x, y]) => Math.hypot(x, y))) + 0.75 * this.pitch;
      const e = (this.elevation * Math.PI) / 180;
      const [up, down] = [reach * Math.sin(e) + this.max * Math.cos(e), reach * Math.sin(e)];
      this.svg.setAttribute("viewBox", `${-reach} ${-up} ${2 * reach} ${up + down}`);
    },

    // Drawing.

    build() {
      this.svg = this.$el.querySelector(".array-figure");
      this.svg.setAttribute("aria-label", `Array of ${this.positions.length} bubbles`);
      this.shade = `shade-${(arrays += 1)}`;
      const defs = make(this.svg, "defs");
      const shade = make(defs, "radialGradient", { id: this.shade, cx: "38%", cy: "32%", r: "75%" });
      for (const [offset, colour, opacity] of [[0, "#fff", 0.55], [0.35, "#fff", 0.06], [0.75, "#000", 0.05], [1, "#000", 0.32]])
        make(shade, "stop", { offset, "stop-color": colour, "stop-opacity": opacity });
      this.plate = make(this.svg, "g", { class: "plate" });
      this.layer = make(this.svg, "g");
      this.labels = make(this.svg, "g", { class: "labels", "aria-hidden": "true" });
      this.bubbles = this.positions.map((_, bubble) => this.buildBubble(bubble));
      this.svg.addEventListener("pointerdown", (event) => this.grab(event));
      this.svg.addEventListener("pointermove", (event) => this.turn(event));
      for (const end of ["pointerup", "pointercancel"]) this.svg.addEventListener(end, () => (this.held = null));
      this.rows = this.positions.map((_, bubble) => {
        const row = this.$el.querySelector("tbody").insertRow();
        for (let cell = 0; cell < 6; cell++) row.insertCell();
        row.cells[0].textContent = bubble;
        return row;
      });
    },
    buildBubble(bubble) {
      const group = make(this.layer, "g", {
        class: "bubble", role: "button", "aria-label": `Bubble ${bubble}`, tabindex: bubble === this.chosen ? 0 : -1, "data-bubble": bubble,
      });
      const parts = { group, foot: make(this.plate, "ellipse") };
      for (const part of ["doubt", "ghost", "ball", "light", "foreseen"]) parts[part] = make(group, "circle", { class: part });
      parts.light.setAttribute("fill", `url(#${this.shade})`);
      parts.label = make(this.labels, "text");
      parts.name = make(parts.label, "tspan", { class: "number" });
      parts.value = make(parts.label, "tspan");
      const tell = (kind, event) => this.$emit("bubble", { kind, bubble, stamp: stamp(event) });
      group.addEventListener("pointerenter", (event) => tell(event.buttons & 1 ? "paint" : "enter", event));
      group.addEventListener("pointerleave", (event) => tell("leave", event));
      group.addEventListener("pointerdown", (event) => {
        if (event.button) return;
        group.releasePointerCapture?.(event.pointerId);
        this.choose(bubble);
        tell("press", event);
      });
      group.addEventListener("focus", (event) => {
        if (group.matches(":focus-visible")) tell("enter", event);
        this.choose(bubble);
      });
      group.addEventListener("blur", (event) => tell("leave", event));
      group.addEventListener("keydown", (event) => {
        if (event.key.startsWith("Arrow")) this.bubbles[neighbour(this.positions, bubble, event.key)].group.focus();
        else if (event.key === "Enter" || event.key === " ") tell("press", event);
        else return;
        event.preventDefault();
      });
      return parts;
    },
    draw() {
      const now = this.latest;
      if (!now) return;
      this.bubbles.forEach((parts, bubble) => this.drawBubble(parts, bubble, now));
      this.drawStrip();
      if (this.$el.querySelector("details").open) this.fill(now);
    },
    drawBubble(parts, bubble, now) {
      const [x, y] = this.positions[bubble];
      const top = now.h[bubble];
      const across = Math.min(now.a[bubble], top); // what neighbours lift stands higher than it is wide
      const [cx, cy] = this.place(x, y, top - across / 2);
      const circle = (node, u, v, r) => {
        node.setAttribute("cx", u.toFixed(2));
        node.setAttribute("cy", v.toFixed(2));
        node.setAttribute("r", Math.max(r, 0).toFixed(2));
      };
      const [gx, gy] = this.place(x, y, now.g[bubble] / 2);
      circle(parts.ghost, gx, gy, now.g[bubble] / 2);
      circle(parts.doubt, cx, cy, across / 2 + (now.sd ? now.sd[bubble] : 0));
      const would = this.foreseen ? this.foreseen[bubble] : 0;
      circle(parts.foreseen, ...this.place(x, y, would / 2).slice(0, 2), would / 2);
      if (this.foreseen) parts.group.dataset.foreseen = would;
      else delete parts.group.dataset.foreseen;
      const [ux, uy] = this.place(x, y, 0);
      for (const [name, value] of Object.entries({ cx: ux, cy: uy, rx: 0.6 * this.pitch, ry: 0.6 * this.pitch * Math.sin((this.elevation * Math.PI) / 180) }))
        parts.foot.setAttribute(name, value.toFixed(2));
      for (const node of [parts.ball, parts.light]) circle(node, cx, cy, across / 2);
      const colour = this.colourOf(bubble, now);
      const fill = `rgb(${colour})`;
      parts.ball.setAttribute("fill", fill);
      parts.group.classList.toggle("chosen", bubble === this.chosen);
      parts.group.classList.toggle("faulty", now.s[bubble] === "fault");
      parts.group.setAttribute("aria-label", this.words(bubble, now));
      parts.label.setAttribute("class", 0.3 * colour[0] + 0.6 * colour[1] + 0.1 * colour[2] < 140 ? "on-dark" : "on-light");
      const rise = (across / 10) * Math.cos((this.elevation * Math.PI) / 180); // who stands before it hides its lower part
      for (const [node, words, down] of [[parts.name, bubble, -0.55], [parts.value, top.toFixed(1), 1.15]]) {
        node.textContent = words;
        node.setAttribute("x", cx.toFixed(2));
        node.setAttribute("y", (cy - rise + down).toFixed(2));
      }
    },
    colourOf(bubble, now) {
      if (this.colour === "status") return rgb(STATUS[now.s[bubble]] || STATUS.unknown);
      if (this.colour === "pressure") return cividis(now.p[bubble] / this.pressure);
      return cividis((now.h[bubble] - this.rest) / (this.max - this.rest));
    },
    words(bubble, now) {
      const faults = now.f[bubble] || [];
      const who = this.recorded ? `Recorded, bubble ${bubble}` : `Bubble ${bubble}`;
      return `${who}: ${now.h[bubble].toFixed(1)} mm, target ${now.g[bubble].toFixed(1)} mm, ${faults.join(", ") || now.s[bubble]}`;
    },
    legend() {
      const legend = this.$el.querySelector(".legend");
      legend.replaceChildren();
      const add = (tag, className, words = "", style = "") => legend.append(Object.assign(document.createElement(tag), { className, textContent: words, style }));
      if (this.colour === "status") {
        for (const name of ["resting", "moving", "settled", "unsure", "missed", "stopped", "fault"]) {
          add("i", "swatch", "", `background:${STATUS[name]}`);
          add("span", "", name);
        }
        return;
      }
      const [low, high, unit] = this.colour === "height" ? [this.rest, this.max, "mm"] : [0, this.pressure, "kPa"];
      add("span", "", low.toFixed(0));
      add("i", "ramp", "", `background:linear-gradient(90deg,${CIVIDIS.join(",")})`);
      add("span", "", `${high.toFixed(0)} ${unit}`);
    },
    fill(now) {
      this.rows.forEach((row, bubble) => {
        const sd = now.sd ? now.sd[bubble].toFixed(2) : "–";
        const cells = [now.h[bubble].toFixed(2), sd, now.g[bubble].toFixed(2), now.p[bubble].toFixed(2), (now.f[bubble] || []).join(", ") || now.s[bubble]];
        cells.forEach((words, cell) => (row.cells[cell + 1].textContent = words));
      });
    },

    // Choosing and turning.

    choose(bubble) {
      this.chosen = bubble;
      keep("bubble", bubble);
      this.bubbles.forEach((parts, other) => parts.group.setAttribute("tabindex", other === bubble ? 0 : -1));
      this.$el.querySelector(".strip-title").textContent = `Bubble ${bubble}`;
      this.$emit("choose", { bubble });
      this.draw();
    },
    grab(event) {
      if (event.target.closest(".bubble") || event.button) return;
      this.held = [event.clientX, event.clientY, this.azimuth, this.elevation];
    },
    turn(event) {
      if (!this.held) return;
      const [x, y, azimuth, elevation] = this.held;
      this.azimuth = azimuth + 0.4 * (event.clientX - x);
      this.elevation = Math.min(90, Math.max(12, elevation + 0.4 * (event.clientY - y)));
      this.order();
      this.draw();
    },

    // The chosen bubble over time.

    buildStrip() {
      const svg = this.$el.querySelector(".strip svg");
      this.grid = make(svg, "g", { class: "grid" });
      for (const part of ["band", "target", "height"]) this[`strip_${part}`] = make(svg, "path", { class: part });
      const { width, height, left, right, top, bottom, seconds } = STRIP;
      this.across = (age) => left + (width - left - right) * (1 - age / seconds);
      this.down = (mm) => top + (height - top - bottom) * (1 - mm / this.max);
      for (let mm = 0; mm <= this.max; mm += 5) {
        make(this.grid, "line", { x1: left, x2: width - right, y1: this.down(mm), y2: this.down(mm) });
        make(this.grid, "text", { x: left - 5, y: this.down(mm) + 3.5, "text-anchor": "end" }).textContent = mm;
      }
      for (let age = 0; age <= seconds; age += 5) {
        const anchor = age ? "middle" : "end";
        const label = make(this.grid, "text", { x: this.across(age), y: height - 5, "text-anchor": anchor });
        label.textContent = age ? `−${age} s` : "now";
        if (!age) this.newest = label;
      }
      make(this.grid, "text", { x: 2, y: top + 4 }).textContent = "mm";
    },
    drawStrip() {
      const now = this.latest.t;
      const line = (value, past = this.past) =>
        past.map((one) => `${this.across(now - one.t).toFixed(1)} ${this.down(value(one)).toFixed(1)}`).join("L");
      const bubble = this.chosen;
      const sd = (one) => (one.sd ? one.sd[bubble] : 0);
      this.strip_height.setAttribute("d", `M${line((one) => one.h[bubble])}`);
      this.strip_target.setAttribute("d", `M${line((one) => one.g[bubble])}`);
      const back = line((one) => one.h[bubble] - sd(one), [...this.past].reverse());
      this.strip_band.setAttribute("d", `M${line((one) => one.h[bubble] + sd(one))}L${back}Z`);
    },
  },
};
