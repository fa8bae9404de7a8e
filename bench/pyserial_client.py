"""pyserial as most write it, as a yardstick: one line after another for as long as an order says."""

import sys
import time

import serial

port = serial.Serial(sys.argv[1], 115200, timeout=1)
line = (sys.argv[2] + "\r\n").encode()
print("ready", flush=True)
for order in sys.stdin:
    count, end = 0, time.monotonic() + int(order) / 1000
    while time.monotonic() < end:
        port.write(line)
        flags, error, value = port.readline().rstrip().split(b",")
        int(flags, 16), int(error, 16), float(value)
        count += 1
    print(count, flush=True)
