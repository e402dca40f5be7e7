# Falsework on the CPU, with Mesa's OpenGL through EGL. Each RUN is a step of the set-up that README.md, the Makefile and .ci/run
# take; tests/house/test_dockerfile.py compares them.
#   docker build -t falsework .
#   docker run --rm -v "$PWD:/work" falsework run bridge.toml -o out
FROM python:3.11-slim-bookworm

RUN apt-get update
RUN apt-get install -y git make python3-venv libegl1 libgl1 libgl1-mesa-dri libidn2-0 libudev1 libx11-6

WORKDIR /opt/falsework
COPY . .
RUN make setup
RUN .venv/bin/falsework doctor

ENV PATH=/opt/falsework/.venv/bin:$PATH
WORKDIR /work
ENTRYPOINT ["falsework"]
CMD ["--help"]
