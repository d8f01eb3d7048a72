# Every third-party package, found once. All are Debian packages; scripts/setup installs them.
# What the libraries need, an installed mapmendConfig.cmake finds again.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Ceres 2.1 REQUIRED)
find_package(ZLIB REQUIRED)
find_package(CLI11 REQUIRED)
find_package(spdlog REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(SQLite3 REQUIRED)
find_package(SQLiteCpp REQUIRED)
include(cmake/ForeignLibraries.cmake)
if(MAPMEND_MISSING_LIBRARIES)
  message(FATAL_ERROR "Not found: ${MAPMEND_MISSING_LIBRARIES}; scripts/setup installs what is needed")
endif()

# What only programs need.
find_path(HTTPLIB_INCLUDE_DIR httplib.h REQUIRED)
find_library(HTTPLIB_LIBRARY cpp-httplib REQUIRED)
find_program(LCM_GEN lcm-gen REQUIRED)

# Of systemd only the notices to a service manager.
find_path(SYSTEMD_INCLUDE_DIR systemd/sd-daemon.h REQUIRED)
find_library(SYSTEMD_LIBRARY systemd REQUIRED)
