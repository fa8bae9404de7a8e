#!/usr/bin/env python3
"""First moves with an SMSD-4.2LAN or SMSD-8.0LAN, real or virtual, through pymodbus.

    pip install pymodbus
    python3 examples/first_move.py [HOST [PORT]]        (default 127.0.0.1 5020, the demo rig)

Logs in with the factory password, looks for the zero switch, goes 600 full steps forward and back to zero, and shows
position and speed on the way. On a real controller it MOVES THE MOTOR: take care that it can, and that a switch is
wired to SET_ZERO behind it.
"""

import sys
import time

from pymodbus.client import ModbusTcpClient

# Addresses and codes of the register table; "HR" holding, "IR" input register, "DI" discrete input, "DO" coil.
SPEED = 0x1000          # IR, and ABS_POS in the two behind it
FLAGS = 0x1200          # DI: HiZ STOP CONST_SPEED ACC DEC READY SW_F SW_EVN DIR CMD_ERROR
MIN_SPEED = 0x1100      # HR: MIN_SPEED MAX_SPEED ACC DEC FS_SPEED TARGET_SPEED TARGET_POS(2) TARGET_INPUT CMD
TARGET_SPEED = 0x1105
CMD = 0x1109
PASSWORD = 0x2100       # HR: four words, lowest first, and Password_CMD
ACCESS = 0x2200         # DI
CLR = 0x1400            # DO
HARD_HIZ = 0x1406       # DO

SCAN_ZERO_R, GO_ZERO, GO_TO = 0x17, 0x1A, 0x1C
MICROSTEPS = 16         # a full step, in the factory's mode 1/16


def words(value):
    """A 32-bit number as two registers, low word first."""
    return [value & 0xFFFF, value >> 16 & 0xFFFF]


class Controller:
    def __init__(self, host, port):
        self.client = ModbusTcpClient(host, port=port)
        if not self.client.connect():
            sys.exit(f"cannot reach {host}:{port}; is `stepdrive up` running?")

    def log_in(self, password=0x0123456789ABCDEF):
        low, high = password & 0xFFFFFFFF, password >> 32
        self.check(self.client.write_registers(PASSWORD, words(low) + words(high) + [0]))
        if not self.check(self.client.read_discrete_inputs(ACCESS, count=1)).bits[0]:
            sys.exit("the password was not accepted; after a wrong one, wait a second before the next try")

    def command(self, code, speed=300, position=0):
        # TARGET_SPEED, TARGET_POS, TARGET_INPUT and CMD follow each other, so one write does it all.
        self.check(self.client.write_registers(TARGET_SPEED, [speed, *words(position), 0, code]))

    def state(self):
        speed, low, high = self.check(self.client.read_input_registers(SPEED, count=3)).registers
        position = (high << 16 | low) - (high >> 15 << 32)
        ready, error = (self.check(self.client.read_discrete_inputs(FLAGS, count=10)).bits[n] for n in (5, 9))
        return speed, position, ready, error

    def watch(self, what):
        while True:
            speed, position, ready, error = self.state()
            print(f"  {what:<22} position {position / MICROSTEPS:8.2f} full steps, speed {speed:5}", flush=True)
            if error:
                sys.exit("the controller refused the command (CMD_ERROR)")
            if ready:
                return
            time.sleep(0.1)

    @staticmethod
    def check(reply):
        if reply.isError():
            sys.exit(f"the controller answered {reply}")
        return reply


def main():
    host = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1"
    port = int(sys.argv[2]) if len(sys.argv) > 2 else 5020
    stage = Controller(host, port)
    stage.log_in()
    stage.check(stage.client.write_coil(CLR, True))
    stage.check(stage.client.write_registers(MIN_SPEED, [50, 1200, 3000, 3000]))
    stage.command(SCAN_ZERO_R, speed=300)
    stage.watch("looking for zero")
    stage.command(GO_TO, position=600 * MICROSTEPS)
    stage.watch("going to 600")
    stage.command(GO_ZERO)
    stage.watch("going back to zero")
    stage.check(stage.client.write_coil(HARD_HIZ, True))
    print("done; the motor is de-energised")


if __name__ == "__main__":
    main()
