"""A Raspberry Pi Pico and what is wired to it on every board. Numbers are GPIOs; docs/hardware.md has the reasons."""

PIN_PUMP = 14  # PWM slice 7, channel A
PIN_DUMP = 15  # high: open
PIN_MISO = 16  # SPI0
PIN_SCK = 18
PIN_MOSI = 19
PIN_DISABLE = 20  # /OE of what drives the valves, pulled up: low lets the valves work
PIN_ESTOP = 28  # pulled up; the loop through the button holds it low, pressed or broken lets it rise
PIN_LED = 25
PIN_SUPPLY = 26  # ADC0
