"""libmodbus by ctypes: the shared library that mbpoll and many others stand on."""

import ctypes

from controller import Controller, Refused
from rig import HOST

# From modbus.h: an exception is reported as an errno of its own.
MODBUS_ENOBASE = 112_345_678

_LIBRARY = ctypes.CDLL("libmodbus.so.5", use_errno=True)
_LIBRARY.modbus_new_tcp.restype = ctypes.c_void_p
_LIBRARY.modbus_new_tcp.argtypes = [ctypes.c_char_p, ctypes.c_int]
_LIBRARY.modbus_strerror.restype = ctypes.c_char_p


class LibmodbusError(Exception):
    """libmodbus reports something that is no exception of Modbus."""


class Libmodbus(Controller):
    """A controller through libmodbus. Without a `unit` it asks the one that libmodbus has for TCP: 255."""

    def __init__(self, port: int, unit: int = None):
        self.context = ctypes.c_void_p(_LIBRARY.modbus_new_tcp(HOST.encode(), port))
        assert self.context.value, "no context"
        if unit is not None:
            self._call("modbus_set_slave", unit)
        self._call("modbus_set_response_timeout", ctypes.c_uint32(2), ctypes.c_uint32(0))
        self._call("modbus_connect")

    def close(self):
        _LIBRARY.modbus_close(self.context)
        _LIBRARY.modbus_free(self.context)

    def coils(self, address, count):
        return self._read("modbus_read_bits", ctypes.c_uint8, address, count, bool)

    def discrete(self, address, count):
        return self._read("modbus_read_input_bits", ctypes.c_uint8, address, count, bool)

    def holding(self, address, count):
        return self._read("modbus_read_registers", ctypes.c_uint16, address, count, int)

    def input(self, address, count):
        return self._read("modbus_read_input_registers", ctypes.c_uint16, address, count, int)

    def write_coil(self, address, value):
        self._call("modbus_write_bit", address, int(value))

    def write_coils(self, address, values):
        packed = (ctypes.c_uint8 * len(values))(*values)
        self._call("modbus_write_bits", address, len(values), packed)

    def write(self, address, value):
        self._call("modbus_write_register", address, value)

    def write_many(self, address, values):
        packed = (ctypes.c_uint16 * len(values))(*values)
        self._call("modbus_write_registers", address, len(values), packed)

    def mask_write(self, address, and_mask, or_mask):
        """Function code 16 (hexadecimal)."""
        self._call("modbus_mask_write_register", address, ctypes.c_uint16(and_mask), ctypes.c_uint16(or_mask))

    def write_and_read(self, write_address, values, read_address, count):
        """Function code 17 (hexadecimal)."""
        packed = (ctypes.c_uint16 * len(values))(*values)
        answer = (ctypes.c_uint16 * count)()
        self._call(
            "modbus_write_and_read_registers", write_address, len(values), packed, read_address, count, answer
        )
        return list(answer)

    def _read(self, function, kind, address, count, convert):
        answer = (kind * count)()
        assert self._call(function, address, count, answer) == count
        return [convert(value) for value in answer]

    def _call(self, function, *arguments):
        ctypes.set_errno(0)
        result = getattr(_LIBRARY, function)(self.context, *arguments)
        if result == -1:
            error = ctypes.get_errno()
            if 0 < error - MODBUS_ENOBASE < 12:
                raise Refused(error - MODBUS_ENOBASE)
            raise LibmodbusError(f"{function}: {_LIBRARY.modbus_strerror(error).decode()}")
        return result
