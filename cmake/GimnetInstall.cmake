# cmake --install: components runtime, development (with the library itself), tools, hub and python.
# Nothing installed names the folder it was installed into, so the prefix may be moved.
include(CMakePackageConfigHelpers)
set(_cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/gimnet)

install(TARGETS gimnet_shared LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT runtime NAMELINK_SKIP)
install(TARGETS gimnet_shared gimnet_static gimnet_bitestream_static EXPORT gimnet
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/gimnet TYPE INCLUDE COMPONENT development)
install(EXPORT gimnet NAMESPACE gimnet:: FILE gimnet-targets.cmake
  DESTINATION ${_cmake_folder} COMPONENT development)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/gimnet-config-version.cmake
  COMPATIBILITY SameMajorVersion)
install(FILES ${PROJECT_SOURCE_DIR}/cmake/gimnet-config.cmake
    ${PROJECT_BINARY_DIR}/gimnet-config-version.cmake
  DESTINATION ${_cmake_folder} COMPONENT development)

# gimnet_pkg_config(NAME DESCRIPTION): NAME.pc. --static adds what libgimnet.a needs.
function(gimnet_pkg_config name description)
  file(RELATIVE_PATH up /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
  get_target_property(needs gimnet_static INTERFACE_LINK_LIBRARIES)
  list(JOIN needs " " needs)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/gimnet.pc.in ${PROJECT_BINARY_DIR}/${name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${name}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endfunction()
gimnet_pkg_config(gimi "Programs on a GIMnet network")
gimnet_pkg_config(nif "Network interface library of GIMnet")
gimnet_pkg_config(bitestream "Labelled binary data of GIMnet")

if(TARGET gimnet)
  install(TARGETS gimnet RUNTIME COMPONENT tools)
endif()
if(TARGET tcphub)
  install(TARGETS tcphub RUNTIME COMPONENT hub)
  install(FILES ${PROJECT_SOURCE_DIR}/docs/tcphub.toml
    DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT hub)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/python/gimnet DESTINATION lib/python3/dist-packages
  COMPONENT python PATTERN __pycache__ EXCLUDE)
