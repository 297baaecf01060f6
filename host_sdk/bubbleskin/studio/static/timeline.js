// The sequence editor's timeline. What is edited is the server's: it sends the whole sequence after every change, and a page sends
// one message for each change that a hand has ended. Changes wait for the answer to the one before, as they build on it.

import inspector from "/studio/inspector.js";
import { curve, label, place, ticks } from "/studio/curves.js";

const HAND_MS = 700; // what a hand does to playhead and choice stays so long, whatever the server says
const ANSWER_MS = 4000;
const SLACK_PX = 4; // a pointer that moves less has only clicked
const LANES = { ruler: 22, repeat: 16, step: 24 };
const STEP_MS = 50;
const STEP_MM = 0.1;
const EDGE_PX = 12;
const DENSE_PX = 7; // keyframes that are closer are not drawn

const same = (one, other) => ["step", "last", "row"].every((name) => one[name] === other[name]);

export default {
  components: { inspector },
  template: `
    <div class="timeline">
      <div class="row timeline-tools">
        <button type="button" class="btn" :disabled="!doc.undo" @click="send(() => ({ kind: 'undo' }))">Undo</button>
        <button type="button" class="btn" :disabled="!doc.redo" @click="send(() => ({ kind: 'redo' }))">Redo</button>
        <label>Rows <select aria-label="Rows" :value="doc.rows_are" @change="show_rows($event.target.value)">
          <option value="bubbles">Bubbles</option><option value="rings">Rings</option><option value="all">All together</option></select></label>
        <span class="zooms" role="group" aria-label="Zoom">
          <button type="button" class="btn" aria-label="Zoom out" @click="zoom_by(1 / 1.6)">−</button>
          <button type="button" class="btn" @click="zoom_by(0)">Fit</button>
          <button type="button" class="btn" aria-label="Zoom in" @click="zoom_by(1.6)">+</button></span>
        <output class="timeline-clock" ref="clock"></output>
      </div>
      <p class="timeline-problem" role="status" v-text="problem"></p>
      <div class="timeline-box">
        <svg class="timeline-names" :width="72" :height="height" aria-hidden="true">
          <text x="66" :y="lanes.steps + 16">Steps</text>
          <text v-for="(row, r) in doc.rows" x="66" :y="top(r) + tall / 2 + 4">{{ row.name }}</text>
        </svg>
        <div class="timeline-scroll" ref="scroll" @scroll="see">
          <svg ref="svg" :width="width" :height="height" role="group" :aria-label="'Timeline of ' + doc.steps.length + ' steps'"
               @keydown="key" @pointermove="drag_on" @pointerup="drag_end" @pointercancel="drag = null">
            <rect class="ruler" x="0" y="0" :width="width" :height="lanes.ruler" @pointerdown="grab_head" />
            <g v-for="tick in shown_ticks" class="tick"><line :x1="x(tick)" :x2="x(tick)" :y1="14" :y2="height" />
              <text :x="x(tick) + 3" y="12">{{ tick / 1000 }} s</text></g>
            <g v-for="one in doc.repeats" class="repeat">
              <rect :x="x(doc.steps[one.first].begin)" :y="lanes.ruler + one.depth * 16 + 1" height="14" rx="4"
                    :width="Math.max(x(doc.steps[one.last].end) - x(doc.steps[one.first].begin), 4)" />
              <text :x="x(doc.steps[one.first].begin) + 5" :y="lanes.ruler + one.depth * 16 + 12">× {{ one.times || "∞" }}</text></g>
            <g v-for="s in seen" :key="'s' + s" class="step" :class="step_class(s)" role="button" :data-step="s"
               :tabindex="focus === 's' + s ? 0 : -1" :aria-label="label(doc, s, outlook)" :aria-pressed="within(s) ? 'true' : 'false'"
               @pointerdown="choose(s, -1, $event.shiftKey)" @focus="focused(s, -1)">
              <rect class="ramp" :x="x(doc.steps[s].begin)" :y="lanes.steps + 2" height="20" rx="3"
                    :width="Math.max(x(doc.steps[s].end) - x(doc.steps[s].begin) - 1, 2)" />
              <rect class="hold" :x="x(doc.steps[s].arrival)" :y="lanes.steps + 3" height="18"
                    :width="Math.max(x(doc.steps[s].end) - x(doc.steps[s].arrival) - 2, 0)" />
              <text v-if="x(doc.steps[s].end) - x(doc.steps[s].begin) > 20" :x="x(doc.steps[s].begin) + 4" :y="lanes.steps + 16">{{
                s }}{{ doc.steps[s].settled ? " ◇" : "" }}</text></g>
            <g v-for="(row, r) in doc.rows">
              <rect class="track" x="0" :y="top(r) + 1" :width="width" :height="tall - 2" :data-row="r" @dblclick="add_here(r, $event)" />
              <path v-for="bubble in row.bubbles" class="curve" :d="curves[bubble](top(r))" />
              <template v-if="row.bubbles.length === 1"><line v-for="[s, mm] in foreseen[row.bubbles[0]]" class="foreseen"
                :x1="x(doc.steps[s].arrival) - 11" :x2="x(doc.steps[s].arrival) + 11" :y1="y(r, mm)" :y2="y(r, mm)" /></template></g>
            <circle v-for="one in handles" :key="one.key" class="handle" :class="one.marks" role="button" r="5.5" :data-key="one.key"
               :cx="x(one.time)" :cy="y(one.row, one.height)" :tabindex="focus === one.key ? 0 : -1" :aria-label="one.label"
               :aria-pressed="chosen.row === one.row && chosen.step === one.step ? 'true' : 'false'"
               @pointerdown="grab(one, $event)" @focus="focused(one.step, one.row)" />
            <g v-if="drag" class="dragged"><circle :cx="x(drag.time)" :cy="y(drag.row, drag.height)" r="6.5" />
              <text :x="x(drag.time) + 10" :y="y(drag.row, drag.height) - 8">{{ drag.time / 1000 }} s, {{ drag.height.toFixed(1) }} mm</text></g>
            <g ref="head" class="head"><line x1="0" x2="0" y1="0" :y2="height" />
              <path d="M-7 0H7V8L0 16L-7 8Z" role="slider" tabindex="0" aria-label="Playhead" aria-valuemin="0" :aria-valuemax="end / 1000"
                    ref="grip" @pointerdown="grab_head" @keydown.stop="head_key" /></g>
          </svg>
        </div>
      </div>
      <p v-if="dense" class="fine">Zoom in to see all keyframes.</p>
      <p class="fine timeline-keys">Drag keyframes, or double-click a row for a new one. By keys: arrows go from one to the next, with Shift they
        move it; Page Up and Page Down by 1 mm, Insert adds one at the playhead, Delete takes it away; Ctrl+Z undoes.</p>
      <inspector :doc="doc" :chosen="chosen" :row="doc.rows[chosen.row]" :easings="easings" :thens="thens" :answers="answers"
                 @say="(what) => send(() => what)" @add="add_at_head" @remove="remove" />
      <section v-if="outlook.says.length" class="timeline-says" aria-live="polite"><h3>What it comes to</h3>
        <ul><li v-for="line in outlook.says">{{ line }}</li></ul></section>
      <label class="upload"><span>Open a file: a sequence as .json, a timeline as .csv</span>
        <input type="file" accept=".json,.csv,.tsv,.txt" @change="upload($event.target)"></label>
    </div>`,
  emits: ["edit", "choose", "look"], // and no "change", which the fields within send too
  props: { first: Object, easings: Array, thens: Array },
  data() {
    const first = JSON.parse(JSON.stringify(this.first)); // what Vue watches cannot be frozen
    return { ...this.parts(first), problem: "", drag: null, answers: 0, room: 600, zoom: 1, from: 0, to: 0 };
  },
  created() {
    this.label = label;
    this.time = this.first.look.time;
    this.queue = [];
    this.waiting = false;
    this.looked = this.picked = -Infinity;
  },
  mounted() {
    this.zoom = Number(sessionStorage.getItem("zoom") || 1);
    this.watcher = new ResizeObserver(() => this.see());
    this.watcher.observe(this.$refs.scroll);
    this.see();
    this.draw_head();
  },
  updated() {
    this.draw_head();
  },
  unmounted() {
    this.watcher.disconnect();
  },
  computed: {
    lanes() {
      const depth = Math.max(0, ...this.doc.repeats.map((one) => one.depth + 1));
      return { ruler: LANES.ruler, steps: LANES.ruler + depth * LANES.repeat };
    },
    tall() {
      return this.doc.rows.length > 10 ? 24 : 36;
    },
    height() {
      return this.top(this.doc.rows.length) + 2;
    },
    end() {
      return this.doc.steps[this.doc.steps.length - 1].end;
    },
    scale() {
      // px for a ms; beyond the end there is room for more.
      return (Math.max(this.room - 2 * EDGE_PX, 100) / (this.end * 1.12 + 300)) * this.zoom;
    },
    width() {
      return Math.max(this.room, (this.end * 1.12 + 300) * this.scale + 2 * EDGE_PX);
    },
    seen() {
      const [from, to] = [this.ms(this.from), this.ms(this.to)];
      return this.doc.steps.map((_, s) => s).filter((s) => this.doc.steps[s].end >= from && this.doc.steps[s].begin <= to);
    },
    dense() {
      return this.seen.length * DENSE_PX > this.room;
    },
    shown_ticks() {
      return ticks(this.ms(this.from), this.ms(this.to), this.scale);
    },
    curves() {
      return Array.from({ length: this.doc.bubbles }, (_, bubble) => curve(this.doc, bubble, this.x, (mm) => this.down(mm)));
    },
    foreseen() {
      // Of each bubble the steps at whose end it will stand elsewhere than it was asked, and where.
      return Array.from({ length: this.doc.bubbles }, (_, bubble) =>
        Object.entries(this.outlook.tops).map(([s, tops]) => [Number(s), tops[bubble]]).filter(([s]) => this.outlook.off.has(`${s}-${bubble}`)));
    },
    handles() {
      const found = [];
      this.doc.rows.forEach((row, r) => {
        for (const s of this.seen) {
          const one = this.keyframe(s, r);
          if (one && (!this.dense || (this.chosen.step === s && this.chosen.row === r))) found.push(one);
        }
      });
      return found;
    },
    focus() {
      const { step, row } = this.chosen;
      return row >= 0 && this.keyframe(step, row) ? `${row}-${step}` : `s${step}`;
    },
  },
  methods: {
    // What the server sends.

    parts({ doc, outlook, look }) {
      const made = { chosen: look.chosen };
      if (doc) made.doc = Object.freeze(doc);
      if (outlook) made.outlook = Object.freeze({ ...outlook, off: new Set(outlook.off), passes: new Set(outlook.passes), never: new Set(outlook.never) });
      return made;
    },
    take(message) {
      const now = performance.now();
      const held = this.$refs.svg.contains(document.activeElement);
      const parts = this.parts(message);
      if ((!message.answer && now - this.picked < HAND_MS) || same(parts.chosen, this.chosen)) delete parts.chosen;
      if (now - this.looked > HAND_MS) this.time = message.look.time;
      Object.assign(this, parts, { problem: message.problem });
      if (this.doc.steps.length <= this.chosen.step) this.chosen = { step: 0, last: 0, row: -1 };
      this.draw_head();
      if (message.look.plays) this.reveal(this.time);
      if (message.answer) this.waiting = false;
      if (message.problem) this.answers += 1; // fields say again what there is
      this.$nextTick(() => {
        if (held && !this.$refs.svg.contains(document.activeElement)) this.focus_chosen(); // what had the focus is gone
        this.pump();
      });
    },
    focus_chosen() {
      const { focus } = this;
      this.$el.querySelector(focus[0] === "s" ? `[data-step='${focus.slice(1)}']` : `[data-key='${focus}']`)?.focus({ preventScroll: true });
    },
    send(make) {
      this.queue.push(make); // made when its turn comes, of what there is then
      this.pump();
    },
    pump() {
      while (!this.waiting && this.queue.length) {
        const what = this.queue.shift()();
        if (!what) continue;
        this.waiting = true;
        this.$emit("edit", { revision: this.doc.revision, ...what });
        clearTimeout(this.patience);
        this.patience = setTimeout(() => {
          this.waiting = false;
          this.queue = [];
        }, ANSWER_MS);
      }
    },
    show_rows(rows) {
      this.send(() => ({ kind: "rows", rows }));
    },
    async upload(input) {
      const [file] = input.files;
      if (!file) return;
      const answer = await fetch(`/sequence?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
      const said = answer.headers.get("content-type")?.includes("json") ? (await answer.json()).problem : await answer.text();
      input.value = "";
      this.problem = said;
    },

    // Where things are.

    x(ms) {
      return EDGE_PX + ms * this.scale;
    },
    ms(x) {
      return (x - EDGE_PX) / this.scale;
    },
    top(row) {
      return this.lanes.steps + LANES.step + row * this.tall;
    },
    down(mm) {
      const share = (Math.min(Math.max(mm, this.doc.low), this.doc.high) - this.doc.low) / (this.doc.high - this.doc.low);
      return this.tall - 5 - share * (this.tall - 10);
    },
    y(row, mm) {
      return this.top(row) + this.down(mm);
    },
    mm(row, y) {
      const share = (this.tall - 5 - (y - this.top(row))) / (this.tall - 10);
      return this.doc.low + Math.min(Math.max(share, 0), 1) * (this.doc.high - this.doc.low);
    },
    see() {
      const box = this.$refs.scroll;
      if (!box) return;
      [this.room, this.from, this.to] = [box.clientWidth, box.scrollLeft - 20, box.scrollLeft + box.clientWidth + 20];
    },
    zoom_by(factor) {
      this.zoom = factor ? Math.min(Math.max(this.zoom * factor, 1), 200) : 1;
      sessionStorage.setItem("zoom", this.zoom);
      this.$nextTick(() => {
        this.$refs.scroll.scrollLeft = this.x(this.time) - this.room / 2;
        this.see();
      });
    },
    keyframe(s, r) {
      const [step, row] = [this.doc.steps[s], this.doc.rows[r]];
      const set = step && row && step.targets ? row.bubbles.map((bubble) => step.targets[bubble]).filter((mm) => mm !== null) : [];
      if (!set.length) return null;
      const height = set.reduce((sum, mm) => sum + mm, 0) / set.length;
      const mixed = set.length < row.bubbles.length || set.some((mm) => mm !== set[0]);
      const off = row.bubbles.some((bubble) => this.outlook.off.has(`${s}-${bubble}`));
      const [passes, never] = [this.outlook.passes.has(s), this.outlook.never.has(s)];
      const high = set.some((mm) => mm > this.doc.high);
      const words = [mixed && "not all alike", off && "cannot be had so", passes && "past the limit", never && "never played", high && "too high"];
      return {
        key: `${r}-${s}`, step: s, row: r, time: step.arrival, height,
        marks: { mixed, off, passes: passes || high, never, chosen: this.chosen.row === r && this.within(s) },
        label: [`${row.name}, step ${s}, ${step.arrival / 1000} s: ${height.toFixed(1)} mm`, ...words.filter(Boolean)].join(", "),
      };
    },
    within(s) {
      const { step, last } = this.chosen;
      return s >= Math.min(step, last) && s <= Math.max(step, last);
    },
    step_class(s) {
      return { chosen: this.within(s), wait: !this.doc.steps[s].targets, passes: this.outlook.passes.has(s), never: this.outlook.never.has(s) };
    },

    // Pointer and keys.

    choose(step, row, extend = false) {
      const chosen = extend ? { ...this.chosen, last: step, row: -1 } : { step, last: step, row };
      if (same(chosen, this.chosen)) return;
      this.chosen = chosen;
      this.picked = performance.now();
      this.$emit("choose", chosen);
    },
    focused(step, row) {
      if (row < 0 ? !this.within(step) : this.chosen.step !== step || this.chosen.row !== row) this.choose(step, row);
    },
    grab(one, event) {
      if (event.button) return;
      this.choose(one.step, one.row, event.shiftKey);
      this.$refs.svg.setPointerCapture(event.pointerId);
      this.held = { ...one, at: [event.clientX, event.clientY], moved: [false, false] };
      this.$nextTick(this.focus_chosen);
      event.preventDefault();
    },
    drag_on(event) {
      if (this.scrubs) this.look(this.ms(place(this.$refs.svg, event)[0]));
      const held = this.held;
      if (!held) return;
      const way = [event.clientX - held.at[0], event.clientY - held.at[1]];
      held.moved = held.moved.map((moved, axis) => moved || Math.abs(way[axis]) >= SLACK_PX);
      if (!held.moved.some(Boolean)) return;
      const time = held.moved[0] ? Math.max(Math.round((held.time + way[0] / this.scale) / 10) * 10, 0) : held.time;
      const height = held.moved[1] ? Math.round(this.mm(held.row, this.y(held.row, held.height) + way[1]) * 10) / 10 : held.height;
      this.drag = { ...held, time, height };
    },
    drag_end() {
      const [held, drag] = [this.held, this.drag];
      this.held = this.drag = this.scrubs = null;
      if (!held || !drag) return;
      const what = { kind: "place", step: drag.step, row: drag.row };
      if (held.moved[0]) what.time = drag.time;
      if (held.moved[1]) what.height = drag.height;
      this.send(() => what);
    },
    add_here(row, event) {
      const [x, y] = place(this.$refs.svg, event);
      const [time, height] = [Math.max(Math.round(this.ms(x) / 10) * 10, 10), Math.round(this.mm(row, y) * 10) / 10];
      this.send(() => ({ kind: "add", row, time, height }));
    },
    add_at_head() {
      this.send(() => ({ kind: "add", row: Math.max(this.chosen.row, 0), time: Math.round(this.time) }));
    },
    remove() {
      this.send(() => ({ kind: "delete", ...this.chosen, row: this.keyframe(this.chosen.step, this.chosen.row) ? this.chosen.row : -1 }));
    },
    nudge(by_ms, by_mm) {
      this.send(() => {
        const one = this.keyframe(this.chosen.step, this.chosen.row);
        const { step } = this.chosen;
        if (by_ms) return { kind: "place", step, time: Math.max(this.doc.steps[step].arrival + by_ms, 0) };
        const height = one && Math.min(Math.max(Math.round((one.height + by_mm) * 1000) / 1000, this.doc.low), this.doc.high);
        return one && { kind: "place", step, row: one.row, height };
      });
    },
    go(steps, rows) {
      // The next keyframe of the row, or the one of another row at about this time.
      let { step, row } = this.chosen;
      if (rows) row = Math.min(Math.max(row + rows, -1), this.doc.rows.length - 1);
      else for (step += steps; this.doc.steps[step] && row >= 0 && !this.keyframe(step, row); ) step += steps;
      if (!this.doc.steps[step]) return;
      this.choose(step, row);
      this.reveal(this.doc.steps[step].arrival);
      this.$nextTick(this.focus_chosen);
    },
    reveal(ms) {
      const box = this.$refs.scroll;
      const x = this.x(ms);
      if (x < box.scrollLeft + 10 || x > box.scrollLeft + box.clientWidth - 10) box.scrollLeft = x - box.clientWidth / 2;
      this.see();
    },
    key(event) {
      const undo = (event.ctrlKey || event.metaKey) && { z: event.shiftKey ? "redo" : "undo", y: "redo" }[event.key.toLowerCase()];
      const act = undo ? () => this.send(() => ({ kind: undo })) : event.shiftKey ? this.moves()[event.key] : this.plain()[event.key];
      if (!act || (!undo && (event.ctrlKey || event.altKey || event.metaKey))) return;
      event.preventDefault();
      const [row, step] = (event.target.dataset.key || `-1-${event.target.dataset.step}`).split(/(?<=\d)-/).map(Number);
      if (step >= 0 && !this.within(step)) this.focused(step, row);
      else if (row >= 0) this.focused(step, row);
      act();
    },
    moves() {
      return {
        ArrowLeft: () => this.nudge(-STEP_MS, 0), ArrowRight: () => this.nudge(STEP_MS, 0),
        ArrowUp: () => this.nudge(0, STEP_MM), ArrowDown: () => this.nudge(0, -STEP_MM),
      };
    },
    plain() {
      const look = () => this.look(this.doc.steps[this.chosen.step].arrival);
      return {
        ArrowLeft: () => this.go(-1, 0), ArrowRight: () => this.go(1, 0), ArrowUp: () => this.go(0, -1), ArrowDown: () => this.go(0, 1),
        PageUp: () => this.nudge(0, 1), PageDown: () => this.nudge(0, -1), Delete: this.remove, Backspace: this.remove,
        Insert: this.add_at_head, Enter: look, " ": look,
      };
    },

    // The playhead: drawn at once, told once a frame.

    grab_head(event) {
      this.scrubs = true;
      this.$refs.svg.setPointerCapture(event.pointerId);
      this.look(this.ms(place(this.$refs.svg, event)[0]));
    },
    head_key(event) {
      const step = event.shiftKey ? 10 * STEP_MS : STEP_MS;
      const to = { ArrowLeft: this.time - step, ArrowRight: this.time + step, Home: 0, End: this.end }[event.key];
      if (to === undefined) return event.key === "Insert" ? this.add_at_head() : undefined;
      event.preventDefault();
      this.look(to);
      this.reveal(this.time);
    },
    look(ms) {
      this.time = Math.min(Math.max(Math.round(ms), 0), this.end);
      this.looked = performance.now();
      this.draw_head();
      if (this.due) return;
      this.due = true;
      requestAnimationFrame(() => {
        this.due = false;
        this.$emit("look", { time: this.time });
      });
    },
    draw_head() {
      this.$refs.head?.setAttribute("transform", `translate(${this.x(this.time).toFixed(1)} 0)`);
      this.$refs.grip?.setAttribute("aria-valuenow", this.time / 1000);
      if (this.$refs.clock) this.$refs.clock.textContent = `${(this.time / 1000).toFixed(2)} s of ${(this.end / 1000).toFixed(2)} s`;
    },
  },
};
