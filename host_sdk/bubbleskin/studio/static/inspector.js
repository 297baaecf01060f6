// The keyframe or the steps that are chosen, as fields. A value is said when it has been given, not at every key; what is still
// being typed stays, whatever the server says meanwhile.

const show = (field, { value }) => {
  if (!field.typed) field.value = value ?? "";
};
const given = {
  mounted(field, binding) {
    field.addEventListener("input", () => (field.typed = true));
    field.addEventListener("change", () => (field.typed = false));
    show(field, binding);
  },
  updated: show,
};

export default {
  directives: { given },
  template: `
    <fieldset class="inspector" v-if="one">
      <legend>{{ row && set.length ? row.name + ", step " + chosen.step : several ? "Steps " + from + " to " + to + "; the fields are those of step " + chosen.step : "Step " + chosen.step }}</legend>
      <div class="fields" :data-answers="answers">
        <label v-if="row">Height (mm) <input type="number" :min="0" :max="doc.high" step="0.1" v-given="height" :placeholder="set.length ? 'not all alike' : 'as it is'"
          @change="say({ kind: 'place', step: chosen.step, row: chosen.row, height: numbered($event) })"></label>
        <label>Ramp (s) <input type="number" min="0" max="60" step="0.05" v-given="one.ramp" @change="step({ ramp: numbered($event) })"></label>
        <label>Easing <select v-given="one.easing" @change="step({ easing: $event.target.value })"><option v-for="word in easings">{{ word }}</option></select></label>
        <label>Goes on <select v-given="one.settled ? 'settled' : 'after'" @change="go_on($event.target.value)">
          <option value="after">after a time</option><option value="settled">when settled</option></select></label>
        <label v-if="!one.settled">Wait (s) <input type="number" min="0" max="60" step="0.05" v-given="one.after" @change="step({ until: { after: numbered($event) } })"></label>
        <template v-else>
          <label>Within (mm) <input type="number" min="0.05" max="5" step="0.05" v-given="one.settled[0]" @change="step({ until: { tolerance_mm: numbered($event) } })"></label>
          <label>At most (s) <input type="number" min="0" max="60" step="0.1" v-given="one.settled[1]" @change="step({ until: { timeout_s: numbered($event) } })"></label>
          <label>Then <select v-given="one.settled[2]" @change="step({ until: { then: $event.target.value } })"><option v-for="word in thens">{{ word }}</option></select></label>
        </template>
        <label>Step's name <input type="text" maxlength="200" v-given="one.name" @change="step({ name: $event.target.value })"></label>
        <label v-for="around in repeats">Repeat of {{ around.first }} to {{ around.last }} <input type="number" min="0" max="65535" v-given="around.times"
          @change="say({ kind: 'times', path: around.path, times: numbered($event) })"></label>
        <label>All of it, times <input type="number" min="0" max="65535" v-given="doc.loops" @change="say({ kind: 'whole', loops: numbered($event) })"></label>
        <label>Sequence's name <input type="text" maxlength="200" v-given="doc.name" @change="say({ kind: 'whole', name: $event.target.value })"></label>
      </div>
      <div class="row">
        <button type="button" class="btn" @click="$emit('add')">Add a keyframe at the playhead</button>
        <button type="button" class="btn" @click="$emit('remove')">{{ row && set.length ? "Delete the keyframe" : several ? "Delete the steps" : "Delete the step" }}</button>
        <button type="button" class="btn" @click="say({ kind: 'repeat', step: from, last: to, times: 2 })">{{
          several ? "Repeat steps " + from + " to " + to : "Repeat step " + chosen.step }}</button>
      </div>
      <p class="fine">Times of 0 are until it is stopped; a repeat of 1 is written once. Shift with a click chooses several steps.</p>
    </fieldset>`,
  props: { doc: Object, chosen: Object, row: Object, easings: Array, thens: Array, answers: Number },
  emits: ["say", "add", "remove"],
  computed: {
    one() {
      return this.doc.steps[this.chosen.step];
    },
    from() {
      return Math.min(this.chosen.step, this.chosen.last);
    },
    to() {
      return Math.max(this.chosen.step, this.chosen.last);
    },
    several() {
      return this.from < this.to;
    },
    set() {
      return this.row && this.one.targets ? this.row.bubbles.map((bubble) => this.one.targets[bubble]).filter((mm) => mm !== null) : [];
    },
    height() {
      const alike = this.set.length === this.row.bubbles.length && this.set.every((mm) => mm === this.set[0]);
      return alike ? this.set[0] : "";
    },
    repeats() {
      return this.doc.repeats.filter((around) => around.first <= this.from && around.last >= this.to);
    },
  },
  methods: {
    say(what) {
      this.$emit("say", what);
    },
    step(what) {
      this.say({ kind: "step", step: this.chosen.step, ...what });
    },
    go_on(how) {
      this.step({ until: how === "settled" ? {} : { after: 0 } });
    },
    numbered(event) {
      return event.target.value === "" ? null : Number(event.target.value);
    },
  },
};
