# How mapmend's own targets are made: one function for libraries, one for programs, one for tests.

# Flags for our own code only; third-party headers come in as SYSTEM.
add_library(mapmend_flags INTERFACE)
target_compile_options(mapmend_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual)
if(MAPMEND_WERROR)
  target_compile_options(mapmend_flags INTERFACE -Werror)
endif()
# popcnt for Hamming distances; no wider, because Eigen's alignment must match Ceres as Debian builds it, and no
# fused multiply-add, so that every x86-64 machine computes the same bits.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  target_compile_options(mapmend_flags INTERFACE -march=x86-64-v2)
endif()
target_compile_options(mapmend_flags INTERFACE -ffp-contract=off)
if(MAPMEND_SANITIZE)
  target_link_options(mapmend_flags INTERFACE -fsanitize=${MAPMEND_SANITIZE})
endif()
target_include_directories(mapmend_flags INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_definitions(mapmend_flags INTERFACE MAPMEND_VERSION="${PROJECT_VERSION}")

# mapmend_sanitize(TARGET): built with the sanitizers of MAPMEND_SANITIZE, if it is among MAPMEND_SANITIZE_TARGETS or that
# is empty. What is left out is built as ever, so that ccache has it.
function(mapmend_sanitize target)
  if(NOT MAPMEND_SANITIZE OR (MAPMEND_SANITIZE_TARGETS AND NOT target IN_LIST MAPMEND_SANITIZE_TARGETS))
    return()
  endif()
  # With sanitizers GCC 12 takes parts of its own <regex> for uninitialised.
  target_compile_options(${target} PRIVATE -fsanitize=${MAPMEND_SANITIZE} -fno-sanitize-recover=all
                         -fno-omit-frame-pointer -O1 -g1 -UNDEBUG -Wno-maybe-uninitialized)
endfunction()

# mapmend_unity(TARGET): its sources are compiled in batches, so that headers, which take most of a compiler's time, are
# read once for several files; MAPMEND_UNITY says how many, 0 compiles each by itself.
function(mapmend_unity target)
  if(MAPMEND_UNITY GREATER 1)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${MAPMEND_UNITY})
    # In a batch, what a class hides in its source (Impl) looks as if others saw it.
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  endif()
endfunction()

# mapmend_test_flags(TARGET): of a test, what it tests must be fast, not the test itself: its compiler hurries.
function(mapmend_test_flags target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()

# mapmend_library(NAME LIBS ...): a static library of every .cc file in the current folder (but main.cc).
function(mapmend_library name)
  cmake_parse_arguments(ARG "" "" "LIBS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cc)
  list(FILTER sources EXCLUDE REGEX "/main\\.cc$")
  list(FILTER sources EXCLUDE REGEX "_benchmark\\.cc$")
  set(include ${PROJECT_SOURCE_DIR})
  if(CMAKE_CURRENT_SOURCE_DIR MATCHES "^${PROJECT_SOURCE_DIR}/libs/")
    set(include $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  endif()
  if(sources)
    add_library(${name} STATIC ${sources})
    target_link_libraries(${name} PUBLIC ${ARG_LIBS} PRIVATE $<BUILD_INTERFACE:mapmend_flags>)
    target_include_directories(${name} PUBLIC ${include})
    mapmend_sanitize(${name})
    mapmend_unity(${name})
  else()
    add_library(${name} INTERFACE)
    target_link_libraries(${name} INTERFACE ${ARG_LIBS})
    target_include_directories(${name} INTERFACE ${include})
  endif()
  if(CMAKE_CURRENT_SOURCE_DIR MATCHES "^${PROJECT_SOURCE_DIR}/libs/")
    mapmend_install_library(${name})
  endif()
endfunction()

# mapmend_program(NAME DESTINATION LIBS ...): the program of main.cc in the current folder. The target "programs" builds all.
add_custom_target(programs)
function(mapmend_program name destination)
  cmake_parse_arguments(ARG "" "" "LIBS" ${ARGN})
  if(NOT EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/main.cc)
    return()
  endif()
  add_executable(${name} main.cc)
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} mapmend_flags)
  mapmend_sanitize(${name})
  add_dependencies(programs ${name})
  install(TARGETS ${name} RUNTIME DESTINATION ${destination} COMPONENT programs)
endfunction()

# mapmend_unit_tests(AREA LIBS ...): tests/unit/AREA/*_test.cc become one program, unit_AREA; ctest lists each TEST.
function(mapmend_unit_tests area)
  cmake_parse_arguments(ARG "" "" "LIBS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${area}/*.cc)
  if(NOT sources)
    return()
  endif()
  add_executable(unit_${area} ${sources})
  target_link_libraries(unit_${area} PRIVATE ${ARG_LIBS} GTest::gtest GTest::gmock GTest::gtest_main mapmend_flags)
  mapmend_sanitize(unit_${area})
  mapmend_unity(unit_${area})
  mapmend_test_flags(unit_${area})
  target_compile_definitions(unit_${area} PRIVATE MAPMEND_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
                                                  MAPMEND_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}")
  gtest_discover_tests(unit_${area} TEST_PREFIX "${area}/" DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
endfunction()

# mapmend_whole_program_tests(AREA LIBS ...): the *_test.cc of the current folder become one program, AREA_tests. Each file
# is one test of ctest, AREA/FILE, since the tests of a file may share a flight.
function(mapmend_whole_program_tests area)
  cmake_parse_arguments(ARG "" "" "LIBS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*_test.cc)
  add_executable(${area}_tests ${sources})
  target_link_libraries(${area}_tests PRIVATE ${ARG_LIBS} GTest::gtest_main mapmend_flags)
  mapmend_unity(${area}_tests)
  mapmend_test_flags(${area}_tests)
  foreach(source ${sources})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${source})
    get_filename_component(name ${source} NAME_WE)
    file(STRINGS ${source} suites REGEX "^TEST(_F|_P)?\\(")
    list(TRANSFORM suites REPLACE "^TEST[_FP]*\\(([A-Za-z0-9_]+),.*" "\\1.*:*/\\1.*")
    list(REMOVE_DUPLICATES suites)
    list(JOIN suites ":" filter)
    add_test(NAME ${area}/${name} COMMAND ${area}_tests --gtest_filter=${filter})
    set_tests_properties(${area}/${name} PROPERTIES TIMEOUT 1800 COST 100  # long: begun first
                         FAIL_REGULAR_EXPRESSION "Running 0 tests")
  endforeach()
endfunction()

# mapmend_benchmark(NAME LIBS ...): NAME_benchmark.cc in the current folder, with Google Benchmark.
function(mapmend_benchmark name)
  cmake_parse_arguments(ARG "" "" "LIBS" ${ARGN})
  if(NOT MAPMEND_BUILD_BENCHMARKS)
    return()
  endif()
  find_package(benchmark REQUIRED)
  add_executable(${name}_benchmark ${name}_benchmark.cc)
  target_link_libraries(${name}_benchmark PRIVATE ${ARG_LIBS} benchmark::benchmark mapmend_flags)
  target_compile_definitions(${name}_benchmark PRIVATE MAPMEND_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
endfunction()
