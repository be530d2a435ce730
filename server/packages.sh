# What building and testing need on Debian 12, and how to get it. Sourced by server/demo.sh and tests/run.sh.
build_packages="cmake ninja-build g++ ccache git ca-certificates pkg-config
  nlohmann-json3-dev libboost-dev libspdlog-dev libfmt-dev libcli11-dev libhdf5-dev zlib1g-dev libeigen3-dev libhwy-dev
  libpagmo-dev libtbb-dev libusb-1.0-0-dev libssl-dev libcurl4-openssl-dev libsystemd-dev libsqlite3-dev prometheus-cpp-dev
  gnuplot-nox dpkg-dev file"
test_packages="libgtest-dev libgmock-dev librapidcheck-dev libsundials-dev libbenchmark-dev
  python3 python3-h5py python3-pandas python3-pip python3-setuptools python3-wheel python3-jsonschema python3-jsonrpclib-pelix
  chromium
  libusb-1.0-0-dev libumockdev-dev umockdev
  debootstrap groff-base
  slurmctld slurmd slurm-client munge"
check_packages="clang-format clang-tidy"

# Installs those of the packages that are missing; root or sudo is needed only then.
install_missing() {
  missing=""
  for package in "$@"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q "install ok installed" || missing="$missing $package"
  done
  # Node.js may come from elsewhere, with npm in it.
  command -v npm >/dev/null 2>&1 || missing="$missing nodejs npm"
  [ -z "$missing" ] && return 0
  as_root=""
  if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null 2>&1 || { echo "root or sudo is needed to install:$missing" >&2; return 1; }
    as_root="sudo"
  fi
  echo "installing:$missing"
  $as_root apt-get update -qq
  $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
}

# The page's plots come from npm. Without it everything else still works.
install_page_modules() {
  npm ci --prefix "$1" --no-audit --no-fund --silent ||
    echo "npm could not bring the page's plots; the page will be without them" >&2
}
