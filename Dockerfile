# lapservo's packages in Debian 12: docker build -t lapservo . && docker run --rm -v "$PWD:/data" lapservo track video.mp4 --rig rig.yaml
# The packages are built from the commit that is checked out; .git is needed for that. Not tried with Docker itself: there was none where
# this was written. What it runs, `./dev package` and apt in a bare Debian 12, is (docs/packages.md).
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
