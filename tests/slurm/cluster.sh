#!/usr/bin/env bash
# A real Slurm of two nodes on this machine, for the tests: every daemon as root, without systemd, on loopback alone.
#
#   cluster.sh install           installs Debian's packages where they are missing; 1, with the reason, where that cannot be
#   cluster.sh start DIR         starts what does not run of the cluster in DIR (at most 60 characters: it holds sockets)
#   cluster.sh stop-controller DIR
#   cluster.sh stop DIR          cancels every job and ends every daemon
#
# SLURM_CONF=DIR/slurm.conf lets sbatch, squeue and the like speak to it.
set -euo pipefail
umask 022
export PATH=$PATH:/usr/sbin:/sbin

nodes="n1 n2"

say() { printf 'cluster.sh: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

is_there() { command -v munged && command -v slurmctld && command -v slurmd && command -v sbatch; } >/dev/null

install() {
  [ "$(id -u)" = 0 ] || die "Slurm's daemons need root"
  is_there && return
  command -v apt-get >/dev/null || die "Slurm is not installed, and there is no apt-get to install it with"
  local apt=(env DEBIAN_FRONTEND=noninteractive apt-get --quiet --yes -o DPkg::Lock::Timeout=120)
  local packages=(slurmctld slurmd slurm-client munge)
  say "installing ${packages[*]}"
  "${apt[@]}" install --no-install-recommends "${packages[@]}" >/dev/null 2>&1 && return
  { "${apt[@]}" update && "${apt[@]}" install --no-install-recommends "${packages[@]}"; } >/dev/null 2>&1 ||
    die "Slurm is not installed, and apt-get cannot install it"
}

# The process of a daemon of this cluster, if it lives. A number may have become another's, and a zombie is none.
process() { # PID-FILE
  local pid state
  pid=$(cat "$1" 2>/dev/null) && state=$(cat "/proc/$pid/stat" 2>/dev/null) || return 1
  state=${state##*) }
  case $state in Z* | X*) return 1 ;; esac
  tr '\0' ' ' <"/proc/$pid/cmdline" | grep -qF -- "$dir/" && echo "$pid"
}

end() { # PID-FILE
  local pid i
  pid=$(process "$1") || return 0
  kill -TERM "$pid" 2>/dev/null || return 0
  for i in $(seq 100); do process "$1" >/dev/null || return 0; sleep 0.1; done
  kill -KILL "$pid" 2>/dev/null || true
}

is_free() { ! (exec 3<>"/dev/tcp/127.0.0.1/$1") 2>/dev/null; }

configure() {
  local host port i n
  host=$(uname -n)
  for i in $(seq 50); do
    port=$((20000 + RANDOM % 1000 * 10))
    for n in 0 1 2 3; do is_free $((port + n)) || continue 2; done
    break
  done
  mkdir -p "$dir"/{log,state,munge} "$dir"/spool/{n1,n2}
  chmod 700 "$dir/state" "$dir/munge"
  (umask 077; head -c 1024 /dev/urandom >"$dir/munge/key")
  cat >"$dir/slurm.conf" <<END
ClusterName=mcpo
SlurmctldHost=${host%%.*}(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
SlurmdUser=root
# On the addresses above alone.
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
AuthType=auth/munge
CredType=cred/munge
# A job that is queued again waits for as long as its old credential is good: usually two minutes.
AuthInfo=socket=$dir/munge/socket,cred_expire=5
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool/%n
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.%n.pid
SlurmctldLogFile=$dir/log/slurmctld
SlurmdLogFile=$dir/log/slurmd.%n
# By default it wants control groups, and where there are none, calls jobs COMPLETED that never ran.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
MailProg=/bin/true
AccountingStorageType=accounting_storage/none
ReturnToService=2
KillWait=5
# Small, so that a plan is more than one array.
MaxArraySize=9
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=0,bf_interval=2,default_queue_depth=1000
# The nodes say what they have, whatever this machine has.
SlurmdParameters=config_overrides
NodeName=n1 NodeHostname=${host%%.*} NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=1 State=UNKNOWN
NodeName=n2 NodeHostname=${host%%.*} NodeAddr=127.0.0.1 Port=$((port + 3)) CPUs=1 State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
  # From version 24 on a node wants a plugin for control groups unless it is told otherwise.
  case $(slurmctld -V) in *" "2[4-9].*) echo CgroupPlugin=disabled >"$dir/cgroup.conf" ;; esac
}

start() {
  local n i
  [ -f "$SLURM_CONF" ] || configure
  process "$dir/munged.pid" >/dev/null || munged --force --key-file="$dir/munge/key" --socket="$dir/munge/socket" \
    --pid-file="$dir/munged.pid" --log-file="$dir/log/munged" --seed-file="$dir/munge/seed" >>"$dir/log/start" 2>&1
  process "$dir/slurmctld.pid" >/dev/null || slurmctld -f "$SLURM_CONF" >>"$dir/log/start" 2>&1
  for n in $nodes; do
    process "$dir/slurmd.$n.pid" >/dev/null || slurmd -f "$SLURM_CONF" -N "$n" >>"$dir/log/start" 2>&1
  done
  for i in $(seq 300); do
    [ "$(sinfo -h -N -o %t 2>/dev/null | grep -cE '^(idle|mix|alloc|comp)$')" = 2 ] && return
    [ $((i % 50)) != 0 ] || for n in $nodes; do scontrol update "nodename=$n" state=resume 2>/dev/null || true; done
    sleep 0.2
  done
  die "the nodes do not come up: $(sinfo -N -o '%N %t %E' 2>&1; tail -n 5 "$dir"/log/*)"
}

# Ending a node's daemon leaves its jobs, on purpose; these stand in the folder of its log.
strays() {
  local d
  for d in /proc/[0-9]*; do
    case $(readlink "$d/exe" 2>/dev/null) in */slurmstepd*) ;; *) continue ;; esac
    [ "$(readlink "$d/cwd" 2>/dev/null)" = "$dir/log" ] && echo "${d#/proc/}"
  done
  return 0
}

stop() {
  local n i
  if process "$dir/slurmctld.pid" >/dev/null; then
    squeue -h -o %F 2>/dev/null | sort -u | xargs -r scancel 2>/dev/null || true
    for i in $(seq 75); do [ -z "$(squeue -h -t R,CG -o %i 2>/dev/null)" ] && break; sleep 0.2; done
  fi
  for n in $nodes; do end "$dir/slurmd.$n.pid"; done
  end "$dir/slurmctld.pid"
  for n in $(strays); do kill -KILL "$n" 2>/dev/null || true; done
  end "$dir/munged.pid"
}

# Nothing of a Slurm around this one may leak in.
for variable in ${!SLURM_@} ${!SBATCH_@} ${!SQUEUE_@} ${!SINFO_@} ${!SCANCEL_@}; do unset "$variable"; done
if [ $# = 2 ]; then
  mkdir -p "$2"
  dir=$(cd "$2" && pwd -P)
  [ ${#dir} -le 60 ] || die "$dir is too long for the sockets in it"
  export SLURM_CONF=$dir/slurm.conf
fi
case "${1:-} $#" in
  "install 1") install ;;
  "start 2") start ;;
  "stop-controller 2") end "$dir/slurmctld.pid" ;;
  "stop 2") stop ;;
  *) sed -n '2,10p' "$0" >&2; exit 2 ;;
esac
