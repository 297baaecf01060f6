"""How often a bring-up says rightly what is wrong with a simulated board: the figures of docs/bring-up.md.

python tools/report/bring_up.py [--seeds 4]      # two minutes
"""

import argparse

import bubbleskin as bs

MISTAKES = {
    "": [],
    "tubes=1-4": ["tubes_swapped"],
    "valves=fill1-fill4": ["fill_valves_swapped"],
    "valves=vent1-vent4": ["vent_valves_swapped"],
    "valves=fill1-vent1": ["fill_and_vent_swapped"],
    "sensors=1-4": ["sensor_wires_swapped"],
    "dead=fill3": ["fill_valve_dead"],
    "dead=vent3": ["vent_valve_dead"],
    "estop=open": ["estop_normally_open"],
    "tubes=2-6&sensors=0-1": ["sensor_wires_swapped", "tubes_swapped"],
}
"""Options of a board, and all that is to be said of it."""
PLANTS = {
    "wristband7": (
        "spread=0.1&rubber=real",
        "spread=0.2",
        "rubber=real&sheet=ecoflex-00-30",
        "sheet=stiff50",
        "viscosity=3&rubber=real",
    ),
    "wristband19": ("spread=0.1&rubber=real", "viscosity=3&rubber=real", "rubber=real&sheet=ecoflex-00-30"),
}


def main() -> None:
    """Bring up every board, and print those of which something else was said."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--seeds", type=int, default=4, help="of each board with 7 bubbles; half as many of those with 19"
    )
    seeds = parser.parse_args().seeds
    boards = wrong = 0
    for board, plants in PLANTS.items():
        for plant in plants:
            for seed in range(seeds if board == "wristband7" else seeds // 2):
                for mistake, expected in MISTAKES.items():
                    options = "&".join(filter(None, (f"seed={seed}", plant, mistake)))
                    with bs.connect(f"sim://{board}?{options}") as skin:
                        found = bs.bring_up(skin)
                    said = sorted(finding.name for finding in found.findings)
                    boards += 1
                    if said != expected or found.ended:
                        wrong += 1
                        print(f"{board}?{options}: {', '.join(said) or found.ended}")
    print(f"{boards - wrong} of {boards} boards were told rightly")


if __name__ == "__main__":
    main()
