#!/bin/bash
# Two hosts on one cable: network namespaces joined by a veth pair, the second with a /dev/shm of its own.
#   two_hosts.sh PYTHON NODE.py CLIENT.py     run in a network namespace of its own (unshare --net)
# The node runs on the first (10.9.0.1), the client on the second (10.9.0.2). Prints what the client prints.
set -eu
python=$1 node=$2 client=$3
ip link set lo up
ip link add near type veth peer name far
unshare --net --mount bash -c 'mount -t tmpfs tmpfs /dev/shm && exec sleep 300' &
host=$!
trap 'kill $(jobs -p) 2> /dev/null' EXIT
for _ in $(seq 100); do [ "$(readlink /proc/$host/ns/net)" != "$(readlink /proc/self/ns/net)" ] && break; sleep 0.05; done
ip link set far netns $host
ip addr add 10.9.0.1/24 dev near
ip link set near up
nsenter --target $host --net ip addr add 10.9.0.2/24 dev far
nsenter --target $host --net ip link set far up
nsenter --target $host --net ip link set lo up
"$python" "$node" &
server=$!
nsenter --target $host --net --mount env -u IR_NETWORK -u FASTRTPS_DEFAULT_PROFILES_FILE \
  ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET ROS_STATIC_PEERS=10.9.0.1 "$python" "$client"
kill $server $host
wait
