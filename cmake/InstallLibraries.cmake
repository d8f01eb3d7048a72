# What other projects need to use the libraries (docs/library.md): archives, headers and a CMake package, all in the
# component "dev". include("mapmend/geometry/camera.h") stands for libs/geometry/camera.h.
set(MAPMEND_ARCHIVE_DIR ${CMAKE_INSTALL_LIBDIR}/mapmend)
set(MAPMEND_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/mapmend)

# Called by mapmend_library for what lies in libs/. The target "libraries" builds all.
add_custom_target(libraries)
function(mapmend_install_library name)
  add_dependencies(libraries ${name})
  target_compile_features(${name} INTERFACE cxx_std_20)
  install(TARGETS ${name} EXPORT mapmend ARCHIVE DESTINATION ${MAPMEND_ARCHIVE_DIR} COMPONENT dev OPTIONAL)
  # Headers name each other by where they lie in the source tree.
  install(CODE "set(MAPMEND_HEADERS_FROM \"${CMAKE_CURRENT_SOURCE_DIR}\")
set(MAPMEND_HEADERS_TO \"${CMAKE_INSTALL_INCLUDEDIR}/mapmend/${name}\")
include(\"${PROJECT_SOURCE_DIR}/cmake/InstallHeaders.cmake\")" COMPONENT dev)
endfunction()

# Called at the end.
function(mapmend_install_package)
  include(CMakePackageConfigHelpers)
  install(EXPORT mapmend NAMESPACE mapmend:: FILE mapmendTargets.cmake DESTINATION ${MAPMEND_PACKAGE_DIR} COMPONENT dev)
  configure_package_config_file(cmake/mapmendConfig.cmake.in ${PROJECT_BINARY_DIR}/mapmendConfig.cmake
                                INSTALL_DESTINATION ${MAPMEND_PACKAGE_DIR})
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/mapmendConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/mapmendConfig.cmake ${PROJECT_BINARY_DIR}/mapmendConfigVersion.cmake
                cmake/ForeignLibraries.cmake DESTINATION ${MAPMEND_PACKAGE_DIR} COMPONENT dev)
  install(DIRECTORY examples DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT dev)
endfunction()
