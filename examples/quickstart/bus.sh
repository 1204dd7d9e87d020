#!/bin/sh
# Makes the virtual CAN interface vcan0 (or the one named), with frames of CAN FD allowed. As root, or by sudo.
set -eu
interface=${1:-vcan0}

# fail MESSAGE: as the program, exit code 3 says that the environment lacks something.
fail() {
    echo "bus.sh: $1" >&2
    exit 3
}

command -v ip >/dev/null || fail "the command ip is missing: sudo apt install iproute2"
if ! ip link show "$interface" >/dev/null 2>&1; then
    modprobe vcan 2>/dev/null || true # it may be built into the kernel
    if ! reason=$(ip link add "$interface" type vcan 2>&1); then
        case $reason in
        *"Operation not permitted"*) fail "$interface can't be made without privileges: sudo $0 $interface" ;;
        *"Unknown device type"* | *"not supported"*)
            fail "the kernel $(uname -r) lacks vcan, the virtual CAN bus (ip: $reason).
Expected the module vcan. Ubuntu has it in a package: sudo apt install linux-modules-extra-$(uname -r)
In a container or a virtual machine of others the kernel is that of its host, and only its owner can add the module.
Without vcan the bench still runs on a bus in memory: \`pytest python\`, \`resonarm run --mode free\`." ;;
        *) fail "$interface can't be made: $reason" ;;
        esac
    fi
fi
reason=$(ip link set "$interface" mtu 72 up 2>&1) || fail "$interface can't be brought up: $reason"
echo "$interface is up"
