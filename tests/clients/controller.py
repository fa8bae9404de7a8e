"""A controller as its client sees it, over whatever client library."""

import time

from pymodbus.client import ModbusTcpClient

from rig import HOST

# Input registers
SPEED, ABS_POS, STATUS, INPUTS = 0x1000, 0x1001, 0x1004, 0x1005
MODE_N_PROGRAMS, N_PROGRAM, N_COMMAND = 0x3000, 0x3001, 0x3002
HW_MAJOR, RM_MAJOR = 0x8001, 0x8007
# Discrete inputs
HIZ, STOP, CONST_SPEED, ACC_FLAG, DEC_FLAG, READY, SW_F, SW_EVN, DIR, CMD_ERROR = range(0x1200, 0x120A)
ACCESS, PROGRAM_RUN = 0x2200, 0x3200
# Holding registers
MIN_SPEED, MAX_SPEED, ACC, DEC, FS_SPEED, TARGET_SPEED, TARGET_POS = range(0x1100, 0x1107)
TARGET_INPUT, CMD = 0x1108, 0x1109
CURRENT_OR_VOLTAGE, MOTOR_TYPE, MICROSTEPPING, WORK_CURRENT, STOP_CURRENT, MASK, WAIT = range(0x110A, 0x1111)
PASSWORD_LOW32, PASSWORD_HIGH32, PASSWORD_CMD = 0x2100, 0x2102, 0x2104
CMD_BUFFER, N_PROG, N_STR, SECTOR_SIZE, PROG_SIZE, MEM_CMD = 0x3100, 0x3180, 0x3181, 0x3182, 0x3183, 0x3184
LAN_ID, LAN_MAC, LAN_IP, LAN_PORT = 0x7000, 0x7001, 0x7007, 0x7017
# Coils
CLR, RESET_POS, RESET, SOFT_STOP, HARD_STOP, SOFT_HIZ, HARD_HIZ, RELAY = range(0x1400, 0x1408)
B_COMPLETE, APPLY = 0x3400, 0x7400

# Codes of CMD
RUN_F, RUN_R, MOVE_F, MOVE_R, GO_TO_F, GO_TO_R, GO_UNTIL_F, GO_UNTIL_R = range(0x0E, 0x16)
SCAN_ZERO_F, SCAN_ZERO_R, SCAN_MARK_F, SCAN_MARK_R, GO_ZERO, GO_MARK, GO_TO = range(0x16, 0x1D)
CMD_SOFT_STOP, CMD_HARD_STOP, CMD_SOFT_HI_Z, CMD_HARD_HI_Z = range(0x1F, 0x23)
SCAN_MARK2_F, SCAN_MARK2_R = 0x3D, 0x3E

# Values of MEM_CMD
MEM_READ, MEM_WRITE, MEM_ERASE, MEM_READ_SIZE, MEM_WRITE_SIZE = range(5)

# Exceptions
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, BUSY = 1, 2, 3, 6

PASSWORD = 0x01234567_89ABCDEF
LOCKOUT_SECONDS = 1.0
# Microsteps in a full step, with the microstep mode as it leaves the factory (1/16).
MICRO = 16
MOVE_SECONDS = 5
BLOCK = 32


class Refused(Exception):
    """The controller answered with an exception."""

    def __init__(self, code: int):
        super().__init__(f"exception {code:02X}")
        self.code = code


def words(value: int) -> list[int]:
    """A value of 32 bits in two registers, the low word first."""
    return [value & 0xFFFF, value >> 16 & 0xFFFF]


def signed(low: int, high: int) -> int:
    """The signed value in two registers."""
    return int.from_bytes((high << 16 | low).to_bytes(4, "big"), "big", signed=True)


def password_words(password: int) -> list[int]:
    """The registers 0x2100 to 0x2103."""
    return words(password & 0xFFFFFFFF) + words(password >> 32)


def instruction(code: int, data: int = 0) -> int:
    """A line of a program."""
    return (data & 0x3FFFFF) << 10 | code << 4


def refusal(action, *arguments) -> int:
    """The exception that `action` is refused with."""
    try:
        action(*arguments)
    except Refused as refused:
        return refused.code
    raise AssertionError(f"{action.__name__}{arguments} was not refused")


def wait_until(condition, seconds: float = MOVE_SECONDS, what: str = "it"):
    """Asks again and again until the answer is yes."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"{what} did not come about within {seconds} s"
        time.sleep(0.002)


class Controller:
    """What can be done with a controller once bits and registers can be read and written."""

    # A client library brings these; each raises `Refused` on an exception.
    def coils(self, address: int, count: int) -> list[bool]:
        raise NotImplementedError

    def discrete(self, address: int, count: int) -> list[bool]:
        raise NotImplementedError

    def holding(self, address: int, count: int) -> list[int]:
        raise NotImplementedError

    def input(self, address: int, count: int) -> list[int]:
        raise NotImplementedError

    def write_coil(self, address: int, value: bool):
        raise NotImplementedError

    def write(self, address: int, value: int):
        raise NotImplementedError

    def write_many(self, address: int, values: list[int]):
        raise NotImplementedError

    # One value
    def flag(self, address: int) -> bool:
        return self.discrete(address, 1)[0]

    def flags(self) -> list[bool]:
        """The flags 0x1200 to 0x1209."""
        return self.discrete(HIZ, 10)

    def position(self) -> int:
        return signed(*self.input(ABS_POS, 2))

    def speed(self) -> int:
        return self.input(SPEED, 1)[0]

    def status(self) -> int:
        return self.input(STATUS, 1)[0]

    # Authorisation (ch. 3)
    def try_password(self, password: int) -> bool:
        """The maker's three steps; returns whether access is allowed now."""
        low_low, low_high, high_low, high_high = password_words(password)
        self.write_many(PASSWORD_LOW32, [low_low, low_high])
        self.write_many(PASSWORD_HIGH32, [high_low, high_high])
        self.write(PASSWORD_CMD, 0)
        return self.flag(ACCESS)

    def log_in(self, password: int = PASSWORD):
        assert self.try_password(password)

    # Motion (ch. 4.2)
    def set_drive(self, max_speed: int = 1000, acc: int = 20_000, dec: int = 20_000, min_speed: int = 0):
        """Drive parameters that make moves short."""
        self.write_many(MIN_SPEED, [min_speed, max_speed, acc, dec])

    def command(self, code: int, position: int = None, speed: int = None):
        """Writes the parameter that the command takes, and then the command."""
        if position is not None:
            self.write_many(TARGET_POS, words(position))
        if speed is not None:
            self.write(TARGET_SPEED, speed)
        self.write(CMD, code)
        assert not self.flag(CMD_ERROR), f"CMD {code:02X} was refused"

    def command_is_refused(self, code: int) -> bool:
        """Gives a command that must be accepted as a write; returns whether it set CMD_ERROR, and clears that."""
        self.write(CMD, code)
        refused = self.flag(CMD_ERROR)
        self.write_coil(CLR, True)
        assert not self.flag(CMD_ERROR)
        return refused

    def wait_ready(self):
        wait_until(lambda: self.flag(READY), what="READY")

    def move(self, code: int, position: int = None, speed: int = None) -> int:
        """A command from beginning to end; returns where it ended."""
        self.command(code, position, speed)
        self.wait_ready()
        return self.position()

    # Program memory (ch. 5)
    def memory_procedure(self, code: int):
        """MEM_CMD, then waits for B_COMPLETE and clears it."""
        self.write(MEM_CMD, code)
        wait_until(lambda: self.coils(B_COMPLETE, 1)[0], what="B_COMPLETE")
        self.write_coil(B_COMPLETE, False)

    def store_program(self, area: int, lines: list[int]):
        """The maker's procedure for writing a program, step by step."""
        self.write(N_PROG, area)
        self.write_coil(B_COMPLETE, False)
        self.memory_procedure(MEM_ERASE)
        for start in range(0, len(lines), BLOCK):
            block = lines[start : start + BLOCK]
            self.write(N_STR, start)
            self.write(SECTOR_SIZE, len(block))
            self.write_many(CMD_BUFFER, [word for line in block for word in words(line)])
            self.memory_procedure(MEM_WRITE)
        self.write(PROG_SIZE, len(lines))
        self.memory_procedure(MEM_WRITE_SIZE)

    def program_size(self, area: int) -> int:
        self.write(N_PROG, area)
        self.write_coil(B_COMPLETE, False)
        self.memory_procedure(MEM_READ_SIZE)
        return self.holding(PROG_SIZE, 1)[0]

    def load_program(self, area: int) -> list[int]:
        """The maker's procedure for reading a program, step by step."""
        size = self.program_size(area)
        lines = []
        for start in range(0, size, BLOCK):
            count = min(BLOCK, size - start)
            self.write(N_STR, start)
            self.write(SECTOR_SIZE, count)
            self.memory_procedure(MEM_READ)
            block = self.holding(CMD_BUFFER, 2 * count)
            lines += [high << 16 | low for low, high in zip(block[::2], block[1::2])]
        return lines


def program_of(length: int) -> list[int]:
    """A program in which every line is another one, with negative numbers and full data fields among them."""
    lines = [instruction(0x06, 16 + number) for number in range(length)]
    lines[1::4] = [instruction(MOVE_F, -number - 1) for number in range(len(lines[1::4]))]
    lines[2::4] = [instruction(GO_TO, 0x1FFFFF - number) for number in range(len(lines[2::4]))]
    lines[-1] = instruction(0x00)
    return lines


class Pymodbus(Controller):
    """A controller through pymodbus."""

    def __init__(self, port: int, unit: int = 1):
        self.unit = unit
        self.client = ModbusTcpClient(HOST, port=port, timeout=2, retries=0)
        assert self.client.connect()

    def close(self):
        self.client.close()

    def coils(self, address, count):
        return self._ask(self.client.read_coils, address, count=count).bits[:count]

    def discrete(self, address, count):
        return self._ask(self.client.read_discrete_inputs, address, count=count).bits[:count]

    def holding(self, address, count):
        return self._ask(self.client.read_holding_registers, address, count=count).registers

    def input(self, address, count):
        return self._ask(self.client.read_input_registers, address, count=count).registers

    def write_coil(self, address, value):
        self._ask(self.client.write_coil, address, value)

    def write_coils(self, address, values):
        self._ask(self.client.write_coils, address, values)

    def write(self, address, value):
        self._ask(self.client.write_register, address, value)

    def write_many(self, address, values):
        self._ask(self.client.write_registers, address, values)

    def is_closed_by_controller(self) -> bool:
        """Waits up to two seconds for the controller to close the connection."""
        self.client.socket.settimeout(2)
        try:
            return self.client.socket.recv(1) == b""
        except ConnectionResetError:
            return True
        except TimeoutError:
            return False

    def _ask(self, function, *arguments, **keywords):
        answer = function(*arguments, device_id=self.unit, **keywords)
        if answer.isError():
            raise Refused(answer.exception_code)
        return answer
