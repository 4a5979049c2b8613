"""BEAR actuators and BRUCE's sensor board: their protocols, byte for byte, on a serial port."""
