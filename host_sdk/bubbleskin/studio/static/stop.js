// Stop and vent go their own way: a request of their own, whatever the page's socket and the rest of the page are doing.

const AGAIN_MS = 1000; // Escape twice within this vents
let escaped = -Infinity;

async function act(what) {
  const alarm = document.getElementById("alarm");
  try {
    const answer = await fetch(`/${what}`, { method: "POST" });
    if (!answer.ok) throw new Error(await answer.text());
    alarm.hidden = true;
  } catch (error) {
    alarm.textContent = `The studio has not answered ${what}: ${error.message}. A wristband whose host is silent holds, and vents within a second or two; its own button stops it at once.`;
    alarm.hidden = false;
  }
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("[data-act]");
  if (button) act(button.dataset.act);
});

document.addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || event.repeat) return;
  const again = event.timeStamp - escaped < AGAIN_MS;
  escaped = again ? -Infinity : event.timeStamp;
  act(again ? "vent" : "stop");
});
