// The map under the wristband. Where the pointer is, the bubbles feel; one message for each frame drawn, however quick the pointer is.

const SVG = "http://www.w3.org/2000/svg";

export default {
  template: `
    <div class="terrain">
      <svg :viewBox="'0 0 ' + size[0] + ' ' + size[1]" tabindex="0" role="application" aria-roledescription="map"
           aria-label="Terrain: move over it with the pointer or the arrow keys" data-terrain>
        <image :href="image" x="0" y="0" :width="size[0]" :height="size[1]" preserveAspectRatio="none" />
        <g class="patch"></g>
      </svg>
      <label class="upload"><span>Your own: a picture, .npy, .tif or a table</span>
        <input type="file" accept=".png,.jpg,.jpeg,.bmp,.webp,.tif,.tiff,.npy,.csv,.tsv,.txt"></label>
    </div>`,
  props: { image: String, size: Array, positions: Array, radius: Number, place: Array },
  mounted() {
    this.at = [...this.place];
    const svg = this.$el.querySelector("svg");
    const patch = this.$el.querySelector(".patch");
    this.circles = this.positions.map(() => patch.appendChild(document.createElementNS(SVG, "circle")));
    svg.addEventListener("pointermove", (event) => {
      const box = svg.getBoundingClientRect();
      const [u, v] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      this.move(u * this.size[0], (1 - v) * this.size[1], event);
    });
    svg.addEventListener("keydown", (event) => {
      const way = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!way) return;
      event.preventDefault();
      const step = this.radius * (event.shiftKey ? 2 : 0.5);
      this.move(this.at[0] + way[0] * step, this.at[1] + way[1] * step, event);
    });
    this.$el.querySelector("input").addEventListener("change", (event) => this.upload(event.target));
    this.mark();
  },
  updated() {
    this.mark();
  },
  methods: {
    move(x, y, event) {
      this.at = [Math.min(Math.max(x, 0), this.size[0]), Math.min(Math.max(y, 0), this.size[1])];
      this.stamp = (performance.timeOrigin + event.timeStamp) / 1000;
      this.moved = true;
      if (!this.due) this.tell();
    },
    tell() {
      // At once where nothing was told in this frame; what comes until the next one is told with it.
      this.due = this.moved;
      if (!this.moved) return;
      this.moved = false;
      this.$emit("point", { x: this.at[0], y: this.at[1], stamp: this.stamp });
      this.mark();
      requestAnimationFrame(() => this.tell());
    },
    mark() {
      this.positions.forEach(([x, y], bubble) => {
        const circle = this.circles[bubble];
        circle.setAttribute("cx", this.at[0] + x);
        circle.setAttribute("cy", this.size[1] - this.at[1] - y);
        circle.setAttribute("r", this.radius);
      });
    },
    async upload(input) {
      const [file] = input.files;
      if (!file) return;
      const answer = await fetch(`/terrain?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
      const said = answer.headers.get("content-type")?.includes("json") ? (await answer.json()).problem : await answer.text();
      input.value = "";
      this.$emit("uploaded", { problem: said });
    },
  },
};
