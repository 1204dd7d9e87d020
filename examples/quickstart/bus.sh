#!/bin/sh
# Makes the virtual CAN interface vcan0 (or the one named), with frames of CAN FD allowed. As root, or by sudo.
set -eu
interface=${1:-vcan0}
modprobe vcan 2>/dev/null || true # it may be built into the kernel
ip link show "$interface" >/dev/null 2>&1 || ip link add "$interface" type vcan
ip link set "$interface" mtu 72 up
echo "$interface is up"
