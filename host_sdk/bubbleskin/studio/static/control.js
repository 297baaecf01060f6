// A slider, a line of text or a choice. What a hand does to it stays: values from the server wait until the hand has gone.

const HAND_MS = 700;

export default {
  template: `
    <select v-if="options" :aria-label="label"><option v-for="[value, words] in options" :value="value">{{ words }}</option></select>
    <input v-else :type="kind" :min="min" :max="max" :step="step" :aria-label="label" :placeholder="hint" autocomplete="off" spellcheck="false">`,
  props: { value: [String, Number], kind: String, min: Number, max: Number, step: Number, label: String, hint: String, options: Array },
  mounted() {
    this.touched = -Infinity;
    this.$el.value = this.value;
    this.$el.addEventListener("input", () => {
      this.touched = performance.now();
      this.$emit("chosen", this.$el.value);
    });
  },
  watch: {
    value: { handler: "take", flush: "post" },
    options: { handler: "take", flush: "post" },
  },
  methods: {
    take() {
      const rest = HAND_MS - (performance.now() - this.touched);
      if (rest > 0) setTimeout(() => this.take(), rest);
      else this.$el.value = this.value;
    },
  },
};
