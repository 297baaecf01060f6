// The array in a notebook: array.js stands before this, as `array`. What the kernel sets is drawn; nothing goes back to it.

function mount(component, root, props) {
  root.innerHTML = component.template;
  const one = { ...props, $el: root.firstElementChild, $emit() {} };
  for (const [name, method] of Object.entries(component.methods)) one[name] = method.bind(one);
  component.mounted.call(one);
  return one;
}

export default {
  render({ model, el }) {
    const root = document.createElement("div");
    root.className = "bubbleskin";
    el.append(root);
    const said = document.createElement("p");
    said.className = "bubbleskin-said";
    said.setAttribute("role", "status");
    const one = mount(array, root, model.get("geometry"));
    root.prepend(said);
    const take = () => {
      const state = model.get("state");
      if (state.t !== undefined) one.take(state);
    };
    const tell = () => {
      said.textContent = model.get("said");
      said.hidden = !said.textContent;
    };
    model.on("change:state", take);
    model.on("change:said", tell);
    take();
    tell();
    return () => {
      model.off("change:state", take);
      model.off("change:said", tell);
    };
  },
};
