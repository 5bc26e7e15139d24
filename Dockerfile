# lapservo's packages in Debian 12, built from the commit that is checked out (.git is needed). How to run it, with network, devices and
# priorities: docs/docker.md. Not tried with Docker itself; what it runs, `./dev package` and apt in a bare Debian 12, is (docs/packages.md).
FROM debian:12-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates git
COPY . /source
WORKDIR /source
RUN git config --global --add safe.directory /source && ./dev package

FROM debian:12-slim
RUN --mount=type=bind,from=build,source=/source/build/package,target=/packages \
    apt-get update && apt-get install -y --no-install-recommends /packages/*.deb gstreamer1.0-plugins-good && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home lapservo
USER lapservo
WORKDIR /data
ENTRYPOINT ["lapservo"]
CMD ["--help"]
